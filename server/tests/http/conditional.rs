//! Reads: forms, validators, what changed since when.

use std::io::Read;

use mapfold_schema::codec::{CBOR, JSON};
use mapfold_schema::route;
use mapfold_schema::v1::{Patch, RasterChanges, VectorPatch};
use reqwest::header::{ACCEPT, ACCEPT_ENCODING, IF_NONE_MATCH};

use crate::server::Server;
use crate::world::Level;

async fn floor(server: &Server) -> Level {
    let floor = Level::create(&server.admin()).await;
    for number in 1..=3 {
        floor.contribute("r1", number).await;
    }
    floor
}

/// What can be read of a level, as paths.
fn reads(floor: &Level) -> Vec<String> {
    vec![
        floor.path(route::LEVEL),
        floor.path(route::VECTOR),
        format!("{}?since=2&bbox=-9,-9,9,9", floor.path(route::VECTOR)),
        floor.path(route::RASTER),
        floor.path(route::RASTER_TILE).replace("{x}/{y}", "0/0"),
        format!("{}?sensor=scanner", floor.path(route::RASTER_TILE).replace("{x}/{y}", "0/0")),
        floor.path(route::TILES).replace("{z}/{row}/{col}", "6/-1/0.png"),
        floor.path(route::TILES).replace("{z}/{row}/{col}", "0/77/-77.png"),
        floor.path(route::PATCHES),
        floor.path(route::EXPORTS).replace("{format}", "geojson"),
        floor.path(route::EXPORTS).replace("{format}", "nav2"),
        floor.path(route::CONTRIBUTIONS),
        route::of_site(route::ROBOTS, "plant"),
        "/openapi.json".to_owned(),
        "/docs/".to_owned(),
        "/".to_owned(),
    ]
}

#[tokio::test(flavor = "multi_thread")]
async fn what_a_client_has_is_not_sent_again_until_it_changes() {
    let server = Server::start().await;
    let floor = floor(&server).await;
    let mut tags = Vec::new();
    for path in reads(&floor) {
        let first = server.admin().get(&path).await.expect(200);
        let tag = first.header("etag").to_owned();
        assert!(tag.starts_with('"') && tag.len() > 16, "{path}: {tag}");
        assert!(first.header("cache-control").contains("no-cache"), "{path}");
        let again = server.admin().get_with(&path, IF_NONE_MATCH, &tag).await.expect(304);
        assert!(again.body.is_empty());
        assert_eq!(again.header("etag"), tag);
        let other = server.admin().get_with(&path, IF_NONE_MATCH, "\"other\"").await.expect(200);
        assert_eq!(other.body, first.body, "{path}");
        tags.push((path, tag));
    }
    floor.contribute("r1", 9).await;
    let changing = tags.iter().filter(|(path, _)| path.contains("/levels/"));
    for (path, tag) in changing.filter(|(path, _)| !path.contains("tiles/0/77")) {
        server.admin().get_with(path, IF_NONE_MATCH, tag).await.expect(200);
    }
}

fn unpacked(coding: &str, body: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut reader: Box<dyn Read> = if coding == "zstd" {
        Box::new(zstd::Decoder::new(body).unwrap())
    } else {
        Box::new(flate2::read::GzDecoder::new(body))
    };
    reader.read_to_end(&mut bytes).unwrap();
    bytes
}

#[tokio::test(flavor = "multi_thread")]
async fn a_compressed_answer_has_a_validator_of_its_own_that_works() {
    let server = Server::start().await;
    let floor = floor(&server).await;
    let path = floor.path(route::VECTOR);
    let plain = server.admin().get(&path).await.expect(200);
    for coding in ["zstd", "gzip"] {
        let coded = server.admin().get_with(&path, ACCEPT_ENCODING, coding).await.expect(200);
        assert_eq!(coded.header("content-encoding"), coding);
        assert_ne!(coded.header("etag"), plain.header("etag"));
        let unpacked = unpacked(coding, &coded.body);
        assert_eq!(unpacked, plain.body);
        let request = server.admin().request(reqwest::Method::GET, &path);
        let request = request.header(ACCEPT_ENCODING, coding);
        let request = request.header(IF_NONE_MATCH, coded.header("etag"));
        let again = crate::client::Answer::to(request).await.expect(304);
        assert_eq!(again.header("etag"), coded.header("etag"));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn json_and_cbor_say_the_same_and_anything_else_is_not_acceptable() {
    let server = Server::start().await;
    let floor = floor(&server).await;
    let path = floor.path(route::PATCHES);
    let json = server.admin().get_with(&path, ACCEPT, JSON).await.expect(200);
    let cbor = server.admin().get_with(&path, ACCEPT, CBOR).await.expect(200);
    assert_eq!((json.header("content-type"), cbor.header("content-type")), (JSON, CBOR));
    assert_eq!(json.data::<Patch>(), cbor.data::<Patch>());
    assert_ne!(json.header("etag"), cbor.header("etag"));
    let path = floor.path(route::VECTOR);
    let geo = server.admin().get_with(&path, ACCEPT, "application/geo+json").await.expect(200);
    let collection: serde_json::Value = serde_json::from_slice(&geo.body).unwrap();
    let vector: VectorPatch = server.admin().get(&path).await.expect(200).data();
    let solid: usize = vector.segments.iter().map(|s| s.solid.len()).sum();
    let features = collection["features"].as_array().unwrap();
    assert_eq!(features.len(), solid + vector.clusters.len() + vector.chains.len());
    for accept in ["text/html", "application/xml", "application/json;q=0"] {
        let answer = server.admin().get_with(&path, ACCEPT, accept).await;
        assert_eq!(answer.code(406), "not_acceptable", "{accept}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn since_answers_what_changed_and_nothing_once_there_is_nothing_new() {
    let server = Server::start().await;
    let floor = floor(&server).await;
    let vector = floor.path(route::VECTOR);
    let all: VectorPatch = server.admin().get(&vector).await.expect(200).data();
    assert_eq!((all.since, all.revision), (0, 3));
    assert!(!all.segments.is_empty());
    for path in [&vector, &floor.path(route::RASTER), &floor.path(route::PATCHES)] {
        let now = server.admin().get(&format!("{path}?since=3")).await.expect(200);
        assert_eq!(now.header("mapfold-revision"), "3");
        let now: serde_json::Value = serde_json::from_slice(&now.body).unwrap();
        for member in ["segments", "clusters", "chains", "tiles"] {
            assert!(now[member].as_array().is_none_or(Vec::is_empty), "{path}: {now}");
        }
        let ahead = server.admin().get(&format!("{path}?since=4")).await.problem(410);
        assert_eq!(ahead.code, "cursor_expired");
        let negative = server.admin().get(&format!("{path}?since=-1")).await;
        assert_eq!(negative.code(400), "query_invalid");
    }
    let nowhere = format!("{vector}?bbox=500,500,501,501");
    let nowhere: VectorPatch = server.admin().get(&nowhere).await.expect(200).data();
    assert!(
        nowhere.segments.is_empty() && nowhere.clusters.is_empty() && nowhere.chains.is_empty()
    );
    for bad in ["bbox=1,2,3", "bbox=3,0,1,1", "bbox=nan,0,1,1", "since=x", "at=3"] {
        let answer = server.admin().get(&format!("{vector}?{bad}")).await;
        assert_eq!(answer.code(400), "query_invalid", "{bad}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tile_is_64_by_64_little_endian_sums() {
    let server = Server::start().await;
    let floor = floor(&server).await;
    let changes: RasterChanges =
        server.admin().get(&floor.path(route::RASTER)).await.expect(200).data();
    assert!((changes.resolution_m - 0.05).abs() < 1e-15);
    assert!(!changes.tiles.is_empty());
    let template = floor.path(route::RASTER_TILE);
    for tile in &changes.tiles {
        let path = template.replace("{x}/{y}", &format!("{}/{}", tile.x, tile.y));
        let bytes = server.admin().get(&path).await.expect(200);
        assert_eq!(bytes.header("content-type"), "application/octet-stream");
        let cells: Vec<i32> = bytes
            .body
            .chunks_exact(4)
            .map(|cell| i32::from_le_bytes(cell.try_into().unwrap()))
            .collect();
        assert_eq!(cells.len(), 64 * 64);
        // Each of the three looks gave cells 0 to 9 85 steps, and cells 64 to 66 -40.
        assert!(cells[..10].iter().all(|cell| *cell == 3 * 85), "{:?}", &cells[..10]);
        assert!(cells[64..67].iter().all(|cell| *cell == -3 * 40));
        let sonar = server.admin().get(&format!("{path}?sensor=sonar")).await;
        assert_eq!(sonar.code(404), "tile_not_found");
    }
    for nothing in ["500/500", "x/0", "0/99999999999"] {
        let answer = server.admin().get(&template.replace("{x}/{y}", nothing)).await;
        assert_eq!(answer.code(404), "tile_not_found", "{nothing}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn pictures_are_png_of_256_pixels_also_where_nothing_is() {
    let server = Server::start().await;
    let floor = floor(&server).await;
    let template = floor.path(route::TILES);
    for (place, layer) in [("6/-1/0", "all"), ("0/0/0", "scanner"), ("8/500/-500", "sonar")] {
        let path = template.replace("{z}/{row}/{col}", &format!("{place}.png"));
        let answer = server.admin().get(&format!("{path}?layer={layer}")).await.expect(200);
        assert_eq!(answer.header("content-type"), "image/png");
        let reader = png::Decoder::new(std::io::Cursor::new(&answer.body)).read_info().unwrap();
        assert_eq!((reader.info().width, reader.info().height), (256, 256));
    }
    for nothing in ["9/0/0.png", "6/0/0", "6/0/0.jpg", "6/0/x.png", "-1/0/0.png"] {
        let answer = server.admin().get(&template.replace("{z}/{row}/{col}", nothing)).await;
        assert_eq!(answer.code(404), "picture_not_found", "{nothing}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn pages_of_patches_add_up_to_a_full_fetch() {
    let server = Server::start().await;
    let floor = floor(&server).await;
    let path = floor.path(route::PATCHES);
    let whole: Patch = server.admin().get(&path).await.expect(200).data();
    assert!(!whole.more);
    let (mut since, mut pages, mut things) = (0, 0, std::collections::BTreeSet::new());
    loop {
        let page: Patch =
            server.admin().get(&format!("{path}?since={since}&limit=1")).await.expect(200).data();
        assert_eq!(page.since, since);
        assert!(page.revision > since);
        things.extend(page.segments.iter().map(|s| s.id.clone()));
        things.extend(page.tiles.iter().map(|t| format!("{:?} {} {}", t.sensor, t.x, t.y)));
        since = page.revision;
        pages += 1;
        if !page.more {
            break;
        }
    }
    assert_eq!(since, whole.revision);
    assert!(pages >= 1 && things.len() == whole.segments.len() + whole.tiles.len());
    let answer = server.admin().get(&format!("{path}?limit=0")).await;
    assert_eq!(answer.code(400), "query_invalid");
}
