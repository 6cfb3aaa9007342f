//! The drawing itself: shapes of a map as SVG. Knows what a map's shapes mean, nothing of where
//! they come from.

use std::fmt::Write as _;

use mapfold_schema::v1::{Chain, ChainKind, Cluster, Segment};

use super::Hallway;
use crate::level::Replica;
use crate::plane::Point;

/// Width of the picture.
const WIDTH_PX: f64 = 1200.0;
/// Space around the map.
const MARGIN_PX: f64 = 30.0;
/// Space for the legend and the caption below it.
const FOOT_PX: f64 = 100.0;
/// Space for the title.
const HEAD_PX: f64 = 16.0;
/// Ellipses of vertices hold 95 % and are drawn so many times as large as they are.
const EXAGGERATION: f64 = 2.0;
/// The root of the 95 % quantile of chi-square with 2 degrees of freedom.
const SD_95: f64 = 2.447_746_830_680_816;
/// Length of the scale bar, metres.
const BAR_M: f64 = 2.0;

const STYLE: &str = "\
text{font-family:'DejaVu Sans',Arial,sans-serif;font-size:13px;fill:#1f2933}\
.title{font-size:17px;font-weight:bold}.small{font-size:11px;fill:#52606d}\
.frame{fill:#fbfcfd;stroke:#cbd2d9;stroke-width:1}.room{fill:#0f8f7a;fill-opacity:.10;stroke:none}\
.obstacle{fill:#0f8f7a;fill-opacity:.35;stroke:none}\
.polygon{fill:none;stroke:#0f8f7a;stroke-width:3.2;stroke-linejoin:round}\
.polyline{fill:none;stroke:#14508c;stroke-width:3.2;stroke-linejoin:round;stroke-linecap:round}\
.lone{fill:none;stroke:#7b8794;stroke-width:2;stroke-linecap:round}\
.cluster{fill:#d97706;fill-opacity:.30;stroke:#b45309;stroke-width:1.1;stroke-linejoin:round}\
.ellipse{fill:#cc3366;fill-opacity:.10;stroke:#cc3366;stroke-width:1}\
.vertex{fill:#14508c}.path{fill:none;stroke:#9aa5b1;stroke-width:1;stroke-dasharray:3 4}\
.stop{fill:#ffffff;stroke:#1f2933;stroke-width:1.3}.ahead{stroke:#1f2933;stroke-width:1.3}\
.number{font-size:9px;text-anchor:middle}.bar{stroke:#1f2933;stroke-width:2;fill:none}";

/// From the level to the page.
struct Page {
    turn: f64,
    left: f64,
    top: f64,
    px_per_m: f64,
}

impl Page {
    /// A place turned as the picture is, still in metres.
    fn turned(&self, p: Point) -> Point {
        let (s, c) = self.turn.sin_cos();
        Point::new(c * p.x + s * p.y, c * p.y - s * p.x)
    }

    fn at(&self, p: Point) -> (f64, f64) {
        let p = self.turned(p);
        (
            MARGIN_PX + (p.x - self.left) * self.px_per_m,
            MARGIN_PX + HEAD_PX + (self.top - p.y) * self.px_per_m,
        )
    }

    fn path(&self, points: &[Point]) -> String {
        let mut text = String::new();
        for p in points {
            let (x, y) = self.at(*p);
            let _ = write!(text, "{}{x:.2} {y:.2}", if text.is_empty() { "M" } else { "L" });
        }
        text
    }
}

/// Draws a map with the places from which each robot saw it.
pub(super) fn plate(map: &Replica, ways: &[Vec<(Point, f64)>], hallway: &Hallway) -> String {
    let mut page = Page { turn: hallway.turned, left: 0.0, top: 0.0, px_per_m: 1.0 };
    let (mut right, mut bottom) = (f64::NEG_INFINITY, f64::INFINITY);
    (page.left, page.top) = (f64::INFINITY, f64::NEG_INFINITY);
    for (at, _) in ways.iter().flatten() {
        let p = page.turned(*at);
        page.left = page.left.min(p.x - hallway.around_m);
        right = right.max(p.x + hallway.around_m);
        bottom = bottom.min(p.y - hallway.around_m);
        page.top = page.top.max(p.y + hallway.around_m);
    }
    page.px_per_m = (WIDTH_PX - 2.0 * MARGIN_PX) / (right - page.left);
    let map_px = (page.top - bottom) * page.px_per_m;
    let height = map_px + 2.0 * MARGIN_PX + HEAD_PX + FOOT_PX;

    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH_PX} {height:.0}\" \
         width=\"{WIDTH_PX}\" height=\"{height:.0}\">\n<style>{STYLE}</style>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
    );
    let frame = format!(
        "x=\"{MARGIN_PX}\" y=\"{:.2}\" width=\"{:.2}\" height=\"{map_px:.2}\"",
        MARGIN_PX + HEAD_PX,
        WIDTH_PX - 2.0 * MARGIN_PX,
    );
    let _ = writeln!(
        svg,
        "<clipPath id=\"map\"><rect {frame}/></clipPath>\n<rect class=\"frame\" {frame}/>\n\
         <g clip-path=\"url(#map)\">"
    );
    for cluster in map.clusters.values() {
        shape(&mut svg, "cluster", &page.path(&hull(cluster)), true);
    }
    uncertainties(&mut svg, map, &page);
    lone_walls(&mut svg, map, &page);
    chains(&mut svg, map, &page);
    let mut number = 1;
    for way in ways {
        positions(&mut svg, way, number, &page);
        number += way.len();
    }
    svg.push_str("</g>\n");
    legend(&mut svg, MARGIN_PX + HEAD_PX + map_px + 28.0, &page);
    caption(&mut svg, map, number - 1, hallway, height);
    svg.push_str("</svg>\n");
    svg
}

fn shape(svg: &mut String, class: &str, path: &str, is_closed: bool) {
    let end = if is_closed { "Z" } else { "" };
    let _ = writeln!(svg, "<path class=\"{class}\" d=\"{path}{end}\"/>");
}

fn vertices(chain: &Chain) -> Vec<Point> {
    chain.vertices_m.iter().map(|[x, y]| Point::new(*x, *y)).collect()
}

fn hull(cluster: &Cluster) -> Vec<Point> {
    cluster.hull_m.iter().map(|[x, y]| Point::new(*x, *y)).collect()
}

/// The ends of a segment's solid parts.
fn parts(segment: &Segment) -> impl Iterator<Item = [Point; 2]> + '_ {
    let (s, c) = segment.alpha_rad.sin_cos();
    let at = move |t: f64| Point::new(segment.rho_m * c - t * s, segment.rho_m * s + t * c);
    segment.solid.iter().map(move |part| [at(part.from_m), at(part.to_m)])
}

fn chains(svg: &mut String, map: &Replica, page: &Page) {
    for chain in map.chains.values() {
        let path = page.path(&vertices(chain));
        match chain.kind {
            ChainKind::Polyline => shape(svg, "polyline", &path, false),
            ChainKind::Room => {
                shape(svg, "room", &path, true);
                shape(svg, "polygon", &path, true);
            }
            ChainKind::Obstacle => {
                shape(svg, "obstacle", &path, true);
                shape(svg, "polygon", &path, true);
            }
        }
        for at in vertices(chain) {
            let (x, y) = page.at(at);
            let _ =
                writeln!(svg, "<circle class=\"vertex\" cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"2.6\"/>");
        }
    }
}

/// The solid parts that no chain's edge runs along.
fn lone(map: &Replica) -> Vec<[Point; 2]> {
    const NEAR_M: f64 = 0.15;
    let mut lone = Vec::new();
    for segment in map.segments.values() {
        let edges: Vec<[Point; 2]> = map
            .chains
            .values()
            .flat_map(|chain| {
                let ring = vertices(chain);
                let edges = chain.segments.iter().enumerate();
                let mine = edges.filter(|(_, id)| **id == segment.id).map(|(i, _)| i);
                mine.map(|i| [ring[i], ring[(i + 1) % ring.len()]]).collect::<Vec<_>>()
            })
            .collect();
        for part in parts(segment) {
            let middle = Point::new(0.5 * (part[0].x + part[1].x), 0.5 * (part[0].y + part[1].y));
            if !edges.iter().any(|[a, b]| distance(middle, *a, *b) <= NEAR_M) {
                lone.push(part);
            }
        }
    }
    lone
}

fn distance(p: Point, a: Point, b: Point) -> f64 {
    let (dx, dy) = (b.x - a.x, b.y - a.y);
    let length_sq = dx * dx + dy * dy;
    let t = (((p.x - a.x) * dx + (p.y - a.y) * dy) / length_sq.max(1e-12)).clamp(0.0, 1.0);
    (p.x - a.x - t * dx).hypot(p.y - a.y - t * dy)
}

fn lone_walls(svg: &mut String, map: &Replica, page: &Page) {
    for part in lone(map) {
        shape(svg, "lone", &page.path(&part), false);
    }
}

/// An ellipse around each vertex of a chain.
fn uncertainties(svg: &mut String, map: &Replica, page: &Page) {
    for chain in map.chains.values() {
        for (at, [[xx, xy], [_, yy]]) in vertices(chain).into_iter().zip(&chain.covariances) {
            let (mean, spread) = (0.5 * (xx + yy), (0.5 * (xx - yy)).hypot(*xy));
            let axis =
                |variance: f64| variance.max(0.0).sqrt() * SD_95 * EXAGGERATION * page.px_per_m;
            let angle = 0.5 * (2.0 * xy).atan2(xx - yy) - page.turn;
            let (x, y) = page.at(at);
            let (major, minor) = (axis(mean + spread), axis(mean - spread));
            let degrees = -angle.to_degrees();
            let _ = writeln!(
                svg,
                "<ellipse class=\"ellipse\" rx=\"{major:.2}\" ry=\"{minor:.2}\" \
                 transform=\"translate({x:.2} {y:.2}) rotate({degrees:.1})\"/>"
            );
        }
    }
}

fn positions(svg: &mut String, stops: &[(Point, f64)], first: usize, page: &Page) {
    let way: Vec<Point> = stops.iter().map(|(at, _)| *at).collect();
    shape(svg, "path", &page.path(&way), false);
    for (number, (at, heading)) in (first..).zip(stops) {
        let (x, y) = page.at(*at);
        let (s, c) = (heading - page.turn).sin_cos();
        let _ = writeln!(
            svg,
            "<path class=\"ahead\" d=\"M{x:.2} {y:.2}l{:.2} {:.2}\"/>\
             <circle class=\"stop\" cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"7.5\"/>\
             <text class=\"number\" x=\"{x:.2}\" y=\"{:.2}\">{number}</text>",
            14.0 * c,
            -14.0 * s,
            y + 3.2
        );
    }
}

fn legend(svg: &mut String, top: f64, page: &Page) {
    let y = top;
    let entries: [(&str, &str, bool); 5] = [
        ("polyline", "polyline of walls", false),
        ("room", "polygon, free inside", true),
        ("obstacle", "polygon, free outside", true),
        ("lone", "wall that meets no other", false),
        ("cluster", "cluster: points in no line", true),
    ];
    for (i, (class, words, is_area)) in entries.into_iter().enumerate() {
        let x = MARGIN_PX + 226.0 * i as f64;
        if is_area {
            let outline = if class == "cluster" { "" } else { "polygon" };
            for class in [class, outline].into_iter().filter(|class| !class.is_empty()) {
                let _ = writeln!(
                    svg,
                    "<rect class=\"{class}\" x=\"{x}\" y=\"{:.2}\" width=\"26\" height=\"14\"/>",
                    y - 11.0
                );
            }
        } else {
            let at = format!("M{x} {:.2}h26", y - 4.0);
            shape(svg, class, &at, false);
        }
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{y:.2}\">{words}</text>", x + 34.0);
    }
    let y = y + 28.0;
    let x = MARGIN_PX;
    let _ = writeln!(
        svg,
        "<circle class=\"stop\" cx=\"{}\" cy=\"{:.2}\" r=\"7.5\"/>\
         <text class=\"number\" x=\"{}\" y=\"{:.2}\">1</text>\
         <text x=\"{}\" y=\"{y:.2}\">scanning position</text>",
        x + 13.0,
        y - 4.0,
        x + 13.0,
        y - 0.8,
        x + 34.0
    );
    let x = MARGIN_PX + 226.0;
    let _ = writeln!(
        svg,
        "<ellipse class=\"ellipse\" cx=\"{}\" cy=\"{:.2}\" rx=\"13\" ry=\"7\"/>\
         <circle class=\"vertex\" cx=\"{}\" cy=\"{:.2}\" r=\"2.4\"/>\
         <text x=\"{}\" y=\"{y:.2}\">vertex; its place is within the ellipse with 95 %, drawn \
         {EXAGGERATION:.0} times as large</text>",
        x + 13.0,
        y - 4.0,
        x + 13.0,
        y - 4.0,
        x + 34.0
    );
    let (right, bar) = (WIDTH_PX - MARGIN_PX, BAR_M * page.px_per_m);
    let _ = writeln!(
        svg,
        "<path class=\"bar\" d=\"M{:.2} {:.2}v5h{bar:.2}v-5\"/>\
         <text text-anchor=\"end\" x=\"{:.2}\" y=\"{y:.2}\">{BAR_M:.0} m</text>",
        right - bar,
        y - 8.0,
        right - bar - 8.0
    );
}

fn caption(svg: &mut String, map: &Replica, stops: usize, hallway: &Hallway, height: f64) {
    let of = |kind: ChainKind| map.chains.values().filter(move |chain| chain.kind == kind);
    let lines = of(ChainKind::Polyline);
    let closed = of(ChainKind::Room).count() + of(ChainKind::Obstacle).count();
    let polygons = format!("{closed} polygon{}", if closed == 1 { "" } else { "s" });
    let edges: usize = map.chains.values().map(|chain| chain.segments.len()).sum();
    let _ = writeln!(
        svg,
        "<text class=\"title\" x=\"{MARGIN_PX}\" y=\"{MARGIN_PX}\">Vector map of a hallway, built \
         from the scans that {} robots took at {stops} positions</text>",
        hallway.ways.len()
    );
    let ways: Vec<String> =
        hallway.ways.iter().map(|way| format!("{} to {}", way.first, way.end - 1)).collect();
    let _ = writeln!(
        svg,
        "<text x=\"{MARGIN_PX}\" y=\"{:.0}\">The whole map: {} walls, {edges} of their parts joined to {} polylines \
         and {polygons}; {} parts meet no other; {} clusters.</text>",
        height - 42.0,
        map.segments.len(),
        lines.count(),
        lone(map).len(),
        map.clusters.len(),
    );
    let _ = writeln!(
        svg,
        "<text class=\"small\" x=\"{MARGIN_PX}\" y=\"{:.0}\">{}: scans {} \
         in tests/data/killian.log.gz, uploaded by two robots, folded and read back through the server; \
         drawn by “make figure”.</text>",
        height - 22.0,
        hallway.place,
        ways.join(" and "),
    );
}
