//! Exports: the committed files, and the same bytes whatever the way.

use std::collections::BTreeMap;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use mapfold_map::geometry::{Covariance, Interval, Line, Point};
use mapfold_map::level::{ContributionId, FeatureId, LevelMap};
use mapfold_map::raster::{LogOdds, SensorClass, TILE_CELLS, Tile, TileIndex, TileKey};
use mapfold_map::vector::{Cluster, EndKind, Facing, Segment, SolidInterval};
use mapfold_schema::geojson;
use mapfold_schema::route;
use mapfold_schema::v1::Import;
use mapfold_server::exchange::nav2::{Content, Description, Image, Nav2Map, Style, load};
use reqwest::header::IF_NONE_MATCH;

use crate::server::Server;
use crate::world::Level;

const UPDATE: &str = "UPDATE=1 cargo test -p mapfold-server --test http exports";

/// A wall with a doorway, a cluster, a post, and cells of both classes.
fn map() -> LevelMap {
    let id = |index| FeatureId { contribution: ContributionId([0x42; 16]), index };
    let span = |from, to| SolidInterval {
        span: Interval { from, to },
        ends: [EndKind::Corner, EndKind::Occluded],
        existence: LogOdds(3468),
    };
    let segment = Segment {
        line: Line::normal_form(2.5, 0.3).0,
        independent: Covariance::from_variances([1e-4, 1e-6]),
        dependent: Covariance::from_variances([4e-4, 4e-6]),
        facing: Facing::Origin,
        solid: vec![span(-1500, 250), span(1150, 4000)],
        looks: 12,
        robots: vec!["ada".into(), "bob".into()],
        first_seen_us: 0,
        last_seen_us: 1_000_000,
    };
    let cluster = |hull: &[[f64; 2]]| Cluster {
        hull: hull.iter().map(|[x, y]| Point::new(*x, *y)).collect(),
        centroid: Point::new(0.5, 0.5),
        covariance: Covariance::from_variances([1e-4, 1e-4]),
        points: 9,
        looks: 3,
        robots: vec!["ada".into()],
        first_seen_us: 0,
        last_seen_us: 1_000_000,
    };
    let mut map = LevelMap::default();
    map.segments.insert(id(0), Arc::new(segment));
    map.clusters.insert(id(0), Arc::new(cluster(&[[0.0, 0.0], [1.0, 0.0], [0.5, 1.0]])));
    map.clusters.insert(id(1), Arc::new(cluster(&[[-0.0, 7.25]])));
    for (class, x, y, shift) in [
        (SensorClass::Scanner, -1, 0, 0),
        (SensorClass::Scanner, 0, 0, 7),
        (SensorClass::Sonar, 0, 0, 3),
    ] {
        let mut cells = Box::new([0; TILE_CELLS]);
        for (offset, cell) in cells.iter_mut().enumerate() {
            *cell = ((offset as i32 * 37 + shift * 11) % 401 - 200) * i32::from(offset % 3 != 0);
        }
        let key = TileKey { class, tile: TileIndex { x, y } };
        map.tiles.insert(key, Arc::new(Tile::new(cells)));
    }
    map
}

#[test]
fn exports_of_a_known_map_are_the_committed_files() {
    let map = map();
    let nav2 = Nav2Map::new(&map, 0.05, Content::default(), Style::default()).unwrap();
    let (mut features, mut image) = (Vec::new(), Vec::new());
    geojson::write_map(&map, &mut features).unwrap();
    nav2.write_image(&mut image).unwrap();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/http/golden");
    for (name, bytes) in [
        ("map.geojson", features),
        ("map.yaml", nav2.description("map.pgm").to_string().into_bytes()),
        ("map.pgm", image),
    ] {
        if std::env::var_os("UPDATE").is_some() {
            std::fs::create_dir_all(&folder).unwrap();
            std::fs::write(folder.join(name), &bytes).unwrap();
        }
        let committed = std::fs::read(folder.join(name)).unwrap_or_default();
        assert!(bytes == committed, "{name} has changed; if it should, run `{UPDATE}`");
    }
}

/// The files of a zip.
fn unzipped(bytes: &[u8]) -> BTreeMap<String, Vec<u8>> {
    let mut zip = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
    let mut files = BTreeMap::new();
    for index in 0..zip.len() {
        let mut file = zip.by_index(index).unwrap();
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).unwrap();
        files.insert(file.name().unwrap().into_owned(), bytes);
    }
    files
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_looks_in_any_order_give_the_same_bytes_over_http_and_on_the_command_line() {
    let mut exports = Vec::new();
    for order in [[1, 2, 3, 4], [4, 2, 1, 3]] {
        let server = Server::start().await;
        let floor = Level::create(&server.admin()).await;
        for number in order {
            floor.contribute("r1", number).await;
        }
        let path = |format| floor.path(route::EXPORTS).replace("{format}", format);
        let geojson = server.admin().get(&path("geojson")).await.expect(200);
        assert_eq!(geojson.header("content-type"), "application/geo+json");
        assert_eq!(
            geojson.header("content-disposition"),
            "attachment; filename=\"plant-floor.geojson\""
        );
        assert_eq!(geojson.header("mapfold-revision"), "4");
        let nav2 = server.admin().get(&path("nav2")).await.expect(200);
        assert_eq!(nav2.header("content-type"), "application/zip");
        exports.push((geojson.body, nav2.body));

        let folder = server.shutdown().await;
        let (features, nav2) = exports.last().unwrap();
        let file = exported(folder.path(), "geojson", "map.geojson");
        assert!(&std::fs::read(file).unwrap() == features);
        let yaml = exported(folder.path(), "nav2", "floor.yaml");
        let zipped = unzipped(nav2);
        assert_eq!(zipped.keys().collect::<Vec<_>>(), ["map.pgm", "map.yaml"]);
        let of_zip = String::from_utf8(zipped["map.yaml"].clone()).unwrap();
        let described = of_zip.replace("image: map.pgm\n", "image: floor.pgm\n");
        assert_ne!(described, of_zip);
        assert_eq!(std::fs::read_to_string(&yaml).unwrap(), described);
        assert!(std::fs::read(yaml.with_file_name("floor.pgm")).unwrap() == zipped["map.pgm"]);
        assert!(!yaml.with_file_name("map.pgm").exists());
    }
    assert!(exports[0] == exports[1], "the order of arrival shows in an export");
}

/// Runs `mapfold-server export` on the data of a server that has stopped.
fn exported(folder: &Path, format: &str, name: &str) -> PathBuf {
    exported_with(folder, format, name, &[])
}

fn exported_with(folder: &Path, format: &str, name: &str, more: &[&str]) -> PathBuf {
    let file = folder.join(name);
    let status = Command::new(env!("CARGO_BIN_EXE_mapfold-server"))
        .args(["export", format, "--site", "plant", "--level", "floor", "--data-dir"])
        .arg(folder.join("data"))
        .arg("--out")
        .arg(&file)
        .args(more)
        .status()
        .unwrap();
    assert!(status.success());
    file
}

#[tokio::test(flavor = "multi_thread")]
async fn a_nav2_map_can_be_had_in_every_mode_and_format_of_each_layer_and_of_a_rectangle() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    floor.contribute("r1", 1).await;
    let path =
        |query: &str| format!("{}{query}", floor.path(route::EXPORTS).replace("{format}", "nav2"));
    let mut zips = BTreeMap::new();
    for (query, image, lines) in [
        ("?mode=trinary&image=pgm&layer=all", "map.pgm", "mode: trinary\n"),
        ("?image=png", "map.png", "mode: trinary\n"),
        ("?mode=scale", "map.png", "occupied_thresh: 1\nfree_thresh: 0\n"),
        ("?mode=raw", "map.pgm", "mode: raw\n"),
        ("?layer=scanner", "map.pgm", "negate: 0\n"),
        ("?bbox=0,0,3.2,3.2", "map.pgm", "origin: [0.0, 0.0, 0.0]\n"),
    ] {
        let answer = server.admin().get(&path(query)).await.expect(200);
        let files = unzipped(&answer.body);
        let yaml = String::from_utf8(files["map.yaml"].clone()).unwrap();
        assert!(yaml.contains(lines) && yaml.starts_with(&format!("image: {image}\n")), "{yaml}");
        let (description, warnings) = Description::read(yaml.as_bytes()).unwrap();
        let loaded = load(&description, &Image::read(&files[image]).unwrap());
        assert_eq!((warnings, loaded.warnings.len()), (vec![], 0), "{query}");
        // Another question is never answered with the other's bytes.
        let tag = answer.header("etag").to_owned();
        let again = server.admin().get_with(&path(query), IF_NONE_MATCH, &tag).await;
        again.expect(304);
        assert!(zips.insert(tag, query).is_none(), "{query}");
    }

    for (query, status, code) in [
        ("?layer=prior", 409, "map_empty"),
        ("?layer=sonar", 409, "map_empty"),
        ("?bbox=900,900,901,901", 409, "map_empty"),
        ("?bbox=-9e9,-9e9,9e9,9e9", 409, "map_too_large"),
        ("?mode=scale&image=pgm", 400, "query_invalid"),
        ("?mode=fancy", 400, "query_invalid"),
        ("?colour=red", 400, "query_invalid"),
    ] {
        assert_eq!(server.admin().get(&path(query)).await.code(status), code, "{query}");
    }
    let geojson = floor.path(route::EXPORTS).replace("{format}", "geojson");
    let refused = server.admin().get(&format!("{geojson}?mode=raw")).await;
    assert_eq!(refused.code(400), "query_invalid");
    let too_large = server.admin().get(&path("?bbox=-9e9,-9e9,9e9,9e9")).await.problem(409);
    assert!(too_large.detail.contains("`bbox`"));

    let by_http = server.admin().get(&path("?mode=scale&bbox=-1,-1,2,2")).await.expect(200);
    let folder = server.shutdown().await;
    let more = ["--mode", "scale", "--bbox", "-1,-1,2,2"];
    let yaml = exported_with(folder.path(), "nav2", "map.yaml", &more);
    let zipped = unzipped(&by_http.body);
    assert!(std::fs::read(&yaml).unwrap() == zipped["map.yaml"]);
    assert!(std::fs::read(yaml.with_file_name("map.png")).unwrap() == zipped["map.png"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_map_without_evidence_has_no_image_and_an_unknown_format_is_none() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let path = |format| floor.path(route::EXPORTS).replace("{format}", format);
    assert_eq!(server.admin().get(&path("nav2")).await.code(409), "map_empty");
    assert_eq!(server.admin().get(&path("svg")).await.code(404), "format_not_found");
    let empty = server.admin().get(&path("geojson")).await.expect(200);
    let empty: serde_json::Value = serde_json::from_slice(&empty.body).unwrap();
    assert_eq!(empty["features"], serde_json::json!([]));
}

#[tokio::test(flavor = "multi_thread")]
async fn an_export_comes_back_as_a_prior_on_the_command_line_as_over_http() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    floor.contribute("r1", 1).await;
    let nav2 = floor.path(route::EXPORTS).replace("{format}", "nav2");
    let zip = server.admin().get(&nav2).await.expect(200).body;
    let path = floor.path(route::IMPORTS);
    let answer = server.admin().post_bytes(&path, "application/zip", zip).await;
    let imported: Import = answer.expect(201).data();
    floor.folded(2).await;
    let of_prior = server.admin().get(&format!("{nav2}?layer=prior")).await.expect(200).body;
    let seen =
        unzipped(&server.admin().get(&format!("{nav2}?layer=scanner")).await.expect(200).body);
    // At a trust of a half a free cell says too little to be written as free again.
    let occupied = |files: &BTreeMap<String, Vec<u8>>| -> Vec<bool> {
        files["map.pgm"].iter().rev().take(64 * 64).map(|grey| *grey == 0).collect()
    };
    assert!(occupied(&seen).contains(&true));
    assert_eq!(occupied(&unzipped(&of_prior)), occupied(&seen));

    let folder = server.shutdown().await;
    let yaml = exported_with(folder.path(), "nav2", "prior.yaml", &["--layer", "scanner"]);
    let import = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mapfold-server"));
        command.arg("import").arg(&yaml).args(["--site", "plant", "--level", "floor"]);
        command.arg("--data-dir").arg(folder.path().join("data")).args(more);
        let output = command.output().unwrap();
        (output.status.success(), String::from_utf8(output.stdout).unwrap())
    };
    let (done, told) = import(&["--preview"]);
    let report = imported.report.unwrap();
    assert!(done && told.contains(&format!("{} occupied", report.occupied)), "{told}");
    assert!(!told.contains("revision"), "{told}");
    let (done, told) = import(&["--trust", "1"]);
    assert!(done && told.contains("since revision 3"), "{told}");
    assert!(import(&["--trust", "1"]).1.contains("since revision 3"));
    assert!(!import(&["--trust", "2"]).0);
}
