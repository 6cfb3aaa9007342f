//! A plan with its landmarks as SVG: what is solid grey, doorways dashed, corners that jut out filled, those of rooms
//! hollow, ends of walls small, doorways across their walls.

use std::fmt::Write as _;

use serde_json::Value;

/// Width of a picture, pixels.
const WIDTH_PX: f64 = 1000.0;
/// What is around the plan, pixels.
const MARGIN_PX: f64 = 20.0;
/// Length of a landmark's ray, pixels.
const RAY_PX: f64 = 8.0;

/// Where the level lies in the picture.
struct Sheet {
    /// Its upper left corner, metres.
    corner: [f64; 2],
    /// Pixels of a metre.
    scale: f64,
}

impl Sheet {
    fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let scaled = [(x - self.corner[0]) * self.scale, (self.corner[1] - y) * self.scale];
        scaled.map(|px| px + MARGIN_PX)
    }
}

fn point(value: &Value) -> Option<[f64; 2]> {
    Some([value.get(0)?.as_f64()?, value.get(1)?.as_f64()?])
}

fn points(value: &Value) -> Vec<[f64; 2]> {
    value.as_array().into_iter().flatten().filter_map(point).collect()
}

/// The lines of a feature.
fn lines(feature: &Value) -> Vec<Vec<[f64; 2]>> {
    let (geometry, of) = (&feature["geometry"], &feature["geometry"]["coordinates"]);
    match geometry["type"].as_str() {
        Some("Polygon") => of.as_array().into_iter().flatten().map(points).collect(),
        Some("LineString") => vec![points(of)],
        _ => Vec::new(),
    }
}

/// The picture of a plan with its landmarks, out of the features of `exports/geojson?of=gdb`.
pub(super) fn of(title: &str, features: &[Value]) -> String {
    let all: Vec<[f64; 2]> = features.iter().flat_map(lines).flatten().collect();
    let least = |axis: usize| all.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
    let most = |axis: usize| all.iter().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
    let corner = [least(0), most(1)];
    let scale = (WIDTH_PX - 2.0 * MARGIN_PX) / (most(0) - corner[0]).max(1e-3);
    let sheet = Sheet { corner, scale };
    let height = (corner[1] - least(1)) * scale + 2.0 * MARGIN_PX;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH_PX} {height:.0}\" font-family=\"sans-serif\">\n\
         <title>{title}</title>\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n"
    );
    let path = |shapes: &[&str]| -> String {
        let wanted = features.iter().filter(|feature| {
            shapes.iter().any(|shape| feature["properties"]["shape"] == *shape)
                && feature["properties"]["kind"] != "landmark"
        });
        let mut path = String::new();
        for line in wanted.flat_map(lines) {
            for (k, p) in line.iter().enumerate() {
                let [x, y] = sheet.place(*p);
                let word = if k == 0 { "M" } else { "L" };
                let _ = write!(path, "{word}{x:.1} {y:.1}"); // writing to a String cannot fail
            }
        }
        path
    };
    let _ = write!(
        svg,
        "<path d=\"{}\" fill=\"#c9d1d9\" fill-rule=\"evenodd\" stroke=\"#3b4650\" stroke-width=\"0.8\"/>\n\
         <path d=\"{}\" fill=\"none\" stroke=\"#3b4650\" stroke-width=\"1.2\"/>\n\
         <path d=\"{}\" fill=\"none\" stroke=\"#0072b2\" stroke-dasharray=\"3 3\"/>\n",
        path(&["room", "obstacle"]),
        path(&["sheet"]),
        path(&["opening"])
    );
    for landmark in features.iter().filter(|f| f["properties"]["kind"] == "landmark") {
        let Some(at) = point(&landmark["geometry"]["coordinates"]) else { continue };
        let heading = landmark["properties"]["heading_rad"].as_f64().unwrap_or_default();
        let [x, y] = sheet.place(at);
        let (dx, dy) = (RAY_PX * heading.cos(), -RAY_PX * heading.sin());
        let (radius, fill, back) = match landmark["properties"]["shape"].as_str() {
            Some("convex_corner") => (3.0, "#b3005e", 0.0),
            Some("concave_corner") => (3.0, "#fff", 0.0),
            Some("wall_end") => (1.8, "#b3005e", 0.0),
            _ => (2.2, "#fff", 1.0),
        };
        let _ = writeln!(
            svg,
            "<path d=\"M{:.1} {:.1}L{:.1} {:.1}\" stroke=\"#b3005e\"/>\
             <circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"{fill}\" stroke=\"#b3005e\"/>",
            x - back * dx,
            y - back * dy,
            x + dx,
            y + dy
        );
    }
    svg.push_str("</svg>\n");
    svg
}
