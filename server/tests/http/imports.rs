//! Maps of other programs as a level's prior: told, taken, replaced, removed, and seen everywhere.

use std::io::{Cursor, Write};
use std::process::Command;

use mapfold_schema::route;
use mapfold_schema::v1::{
    Import, ImportPage, ImportReport, ModelFormat, ModelImport, RasterChanges, Receipt, TilePlace,
};
use reqwest::Method;
use reqwest::header::IF_NONE_MATCH;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use crate::client::{Answer, Client};
use crate::server::Server;
use crate::world::Level;

const ZIP: &str = "application/zip";

fn zipped(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        zip.start_file(*name, SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

/// Four pixels in a row: occupied, free, free and unknown, from (x, 0) on.
fn map_at(x: f64) -> Vec<u8> {
    let yaml = format!(
        "image: map.pgm\nresolution: 0.05\norigin: [{x:?}, 0.0, 0.0]\nnegate: 0\n\
         occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    );
    zipped(&[("map.yaml", yaml.as_bytes()), ("map.pgm", b"P5\n4 1\n255\n\x00\xfe\xfe\xcd")])
}

async fn post(floor: &Level, client: &Client, query: &str, zip: Vec<u8>) -> Answer {
    client.post_bytes(&format!("{}{query}", floor.path(route::IMPORTS)), ZIP, zip).await
}

async fn delete(floor: &Level) -> Answer {
    Answer::to(floor.client.request(Method::DELETE, &floor.path(route::IMPORTS))).await
}

/// A tile's cells; `None` if it is not there.
async fn cells(floor: &Level, query: &str) -> Option<Vec<i32>> {
    let path = floor.path(route::RASTER_TILE).replace("{x}", "0").replace("{y}", "0");
    let answer = floor.client.get(&format!("{path}{query}")).await;
    if answer.status == 404 {
        return None;
    }
    let (cells, _) = answer.body.as_chunks::<4>();
    Some(cells.iter().map(|bytes| i32::from_le_bytes(*bytes)).collect())
}

async fn picture(floor: &Level, query: &str) -> Vec<u8> {
    let path = floor.path(route::TILES);
    let path = path.replace("{z}", "6").replace("{row}", "-1").replace("{col}", "0.png");
    floor.client.get(&format!("{path}{query}")).await.expect(200).body
}

async fn changes(floor: &Level, since: i64) -> RasterChanges {
    let path = format!("{}?since={since}", floor.path(route::RASTER));
    floor.client.get(&path).await.expect(200).data()
}

const HERE: TilePlace = TilePlace { x: 0, y: 0 };

#[tokio::test(flavor = "multi_thread")]
async fn a_preview_tells_and_changes_nothing_and_an_import_is_seen_in_every_reading() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let admin = server.admin();
    let told: ImportReport =
        post(&floor, &admin, "?preview=true", map_at(0.0)).await.expect(200).data();
    assert_eq!((told.occupied, told.free, told.unknown, told.tiles), (1, 2, 1, 1));
    assert_eq!((told.columns, told.rows, told.warnings.len()), (4, 1, 0));
    assert_eq!(floor.describe().await.revision, 0);

    let made: Import = post(&floor, &admin, "", map_at(0.0)).await.expect(201).data();
    assert_eq!((made.revision, made.report.as_ref()), (1, Some(&told)));
    floor.folded(1).await;
    let again: Import = post(&floor, &admin, "", map_at(0.0)).await.expect(201).data();
    assert_eq!(again, made, "the same map again changes nothing");

    assert_eq!(cells(&floor, "").await, None, "a prior is no evidence of robots");
    let prior = cells(&floor, "?layer=prior").await.unwrap();
    assert_eq!(prior[..5], [200, -25, -25, 0, 0]);
    assert_eq!(cells(&floor, "?layer=all").await.as_deref(), Some(&prior[..]));
    let seen = changes(&floor, 0).await;
    assert_eq!((seen.prior, seen.removed_prior, seen.tiles), (vec![HERE], vec![], vec![]));
    assert_eq!(picture(&floor, "?layer=prior").await, picture(&floor, "?layer=all").await);
    assert_ne!(picture(&floor, "?layer=prior").await, picture(&floor, "?layer=scanner").await);
    let counts = floor.describe().await.counts;
    assert_eq!((counts.prior_tiles, counts.tiles), (1, 0));
    let nav2 = floor.path(route::EXPORTS).replace("{format}", "nav2");
    floor.client.get(&format!("{nav2}?layer=prior")).await.expect(200);
    floor.client.get(&format!("{nav2}?layer=scanner")).await.expect(409);

    // What robots see is added above it, and stays apart from it.
    let receipt: Receipt = floor.contribute("r1", 1).await;
    assert_eq!(receipt.revision, 2);
    let seen = cells(&floor, "").await.unwrap();
    let all = cells(&floor, "?layer=all").await.unwrap();
    assert!(all.iter().zip(&seen).zip(&prior).all(|((all, seen), prior)| *all == seen + prior));
    assert_eq!(cells(&floor, "?layer=prior").await.unwrap(), prior);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_next_import_takes_the_place_of_the_last_and_a_removal_leaves_nothing() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let admin = server.admin();
    assert_eq!(delete(&floor).await.code(404), "prior_not_found");
    post(&floor, &admin, "", map_at(0.0)).await.expect(201);
    post(&floor, &admin, "?trust=1", map_at(32.0)).await.expect(201);
    floor.folded(2).await;
    let (seen, there) = (changes(&floor, 1).await, TilePlace { x: 10, y: 0 });
    assert_eq!((seen.prior, seen.removed_prior), (vec![there], vec![HERE]));
    assert_eq!(cells(&floor, "?layer=prior").await, None);

    let removed: Import = delete(&floor).await.expect(200).data();
    assert_eq!((removed.revision, removed.report), (3, None));
    floor.folded(3).await;
    let seen = changes(&floor, 2).await;
    assert_eq!((seen.prior, seen.removed_prior), (vec![], vec![there]));
    assert_eq!(floor.describe().await.counts.prior_tiles, 0);
    assert_eq!(delete(&floor).await.code(404), "prior_not_found");

    let page: ImportPage = floor.client.get(&floor.path(route::IMPORTS)).await.expect(200).data();
    assert_eq!(page.imports.iter().map(|i| i.revision).collect::<Vec<_>>(), [3, 2, 1]);
    assert_eq!(page.imports[1].report.as_ref().map(|report| report.trust), Some(1.0));
    let path = format!("{}?limit=2", floor.path(route::IMPORTS));
    let first: ImportPage = floor.client.get(&path).await.expect(200).data();
    let path = format!("{path}&cursor={}", first.next.unwrap());
    let rest: ImportPage = floor.client.get(&path).await.expect(200).data();
    assert_eq!((rest.imports.len(), rest.next), (1, None));
    // The same map may come again after it was taken away.
    let again: Import = post(&floor, &admin, "", map_at(0.0)).await.expect(201).data();
    assert_eq!(again.revision, 4);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_taken_is_told_and_changes_nothing() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let admin = server.admin();
    let yaml = b"image: map.pgm\nresolution: 0.05\norigin: [0, 0]\n";
    let good = b"image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n\
        occupied_thresh: 0.65\nfree_thresh: 0.196\n";
    for (zip, status, code, words) in [
        (b"no zip".to_vec(), 422, "invalid_map_package", "zip"),
        (
            zipped(&[("a.yaml", yaml)]),
            422,
            "invalid_map_metadata",
            "3, column 9 of the description",
        ),
        (zipped(&[("a.yaml", good)]), 422, "invalid_map_package", "`map.pgm`"),
        (
            zipped(&[("a.yaml", good), ("map.pgm", b"P5 2 2 255\n")]),
            422,
            "invalid_map_data",
            "yte 11",
        ),
        (
            zipped(&[("a.yaml", good), ("map.pgm", b"P5 100000 100000 255\n")]),
            413,
            "image_too_large",
            "100000 by 100000",
        ),
    ] {
        let problem = post(&floor, &admin, "", zip).await.problem(status);
        assert_eq!(problem.code, code);
        assert!(problem.detail.contains(words), "{}", problem.detail);
    }
    let refused = post(&floor, &admin, "?trust=2", map_at(0.0)).await;
    assert_eq!(refused.code(400), "query_invalid");
    let path = floor.path(route::IMPORTS);
    let json = admin.post_bytes(&path, "application/pdf", map_at(0.0)).await;
    assert_eq!(json.code(415), "unsupported_media_type");
    let robot = server.with(&floor.token("r1").await);
    assert_eq!(post(&floor, &robot, "", map_at(0.0)).await.code(403), "insufficient_scope");
    assert_eq!(floor.describe().await.revision, 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn many_tiles_come_in_one_answer_the_same_as_one_by_one() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    post(&floor, &server.admin(), "", map_at(0.0)).await.expect(201);
    floor.contribute("r1", 1).await;
    let batch = floor.path(route::RASTER_BATCH);
    for query in ["", "&layer=scanner", "&layer=prior", "&layer=all"] {
        let path = format!("{batch}?tiles=0,0,-7,9,0,0{query}");
        let answer = floor.client.get(&path).await.expect(200);
        assert_eq!(answer.header("content-type"), "application/vnd.mapfold.tiles");
        assert_eq!(answer.header("mapfold-revision"), "2");
        let one = cells(&floor, &query.replace('&', "?")).await;
        let (head, mut rest) = answer.body.split_at(8);
        assert_eq!(head, b"mft1\x03\x00\x00\x00");
        for place in [(0, 0), (-7, 9), (0, 0)] {
            let number = |at: usize| i32::from_le_bytes(rest[at..at + 4].try_into().unwrap());
            assert_eq!((number(0), number(4)), place);
            let length = number(8) as usize;
            let packed = &rest[12..12 + length];
            if place == (0, 0) {
                let bytes = zstd::bulk::decompress(packed, 64 * 64 * 4).unwrap();
                let (cells, _) = bytes.as_chunks::<4>();
                let cells: Vec<i32> = cells.iter().map(|cell| i32::from_le_bytes(*cell)).collect();
                assert_eq!(Some(cells), one, "{query}");
            } else {
                assert_eq!(length, 0);
            }
            rest = &rest[12 + length..];
        }
        assert!(rest.is_empty());
        let tag = answer.header("etag").to_owned();
        floor.client.get_with(&path, IF_NONE_MATCH, &tag).await.expect(304);
    }
    let many = vec!["1"; 2 * 257].join(",");
    for bad in ["", "?tiles=1", &format!("?tiles={many}")] {
        let refused = floor.client.get(&format!("{batch}{bad}")).await;
        assert_eq!(refused.code(400), "query_invalid", "{bad}");
    }
}

/// A wall of 40 by 4 cells, with a doorway of 16 cells in it.
fn map_of_a_wall() -> (Vec<u8>, Vec<u8>) {
    let yaml = "image: map.pgm\nresolution: 0.05\norigin: [1.0, 2.0, 0.0]\nnegate: 0\n\
                occupied_thresh: 0.65\nfree_thresh: 0.196\n";
    let mut image = b"P5\n60 20\n255\n".to_vec();
    for row in 0..20 {
        let is_wall = |column: i32| {
            (8..12).contains(&row) && (10..50).contains(&column) && !(22..38).contains(&column)
        };
        image.extend((0..60).map(|column| if is_wall(column) { 0 } else { 254 }));
    }
    (yaml.as_bytes().to_vec(), image)
}

#[tokio::test(flavor = "multi_thread")]
async fn the_occupied_cells_of_a_map_become_walls_of_the_draft_over_http_and_on_the_command_line() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let (yaml, image) = map_of_a_wall();
    let zip = zipped(&[("map.yaml", &yaml), ("map.pgm", &image)]);
    let client = &floor.client;
    let told: ModelImport =
        post(&floor, client, "?into=gdb&preview=true", zip.clone()).await.expect(200).data();
    assert_eq!((told.report.format, told.preview.unwrap().new), (ModelFormat::Nav2, 2));
    assert_eq!(floor.describe().await.revision, 0);
    let made: ModelImport = post(&floor, client, "?into=gdb", zip.clone()).await.expect(201).data();
    let entry = made.answer.unwrap().entry.unwrap();
    assert_eq!((entry.revision, entry.put), (1, 2));
    let bounds = made.report.bounds.unwrap();
    // From cell 10 to 50 across and 8 to 12 up, about an origin of (1, 2) m.
    let found = [bounds.min_x_m, bounds.max_x_m, bounds.min_y_m, bounds.max_y_m];
    assert!(found.iter().zip([1.5, 3.5, 2.4, 2.6]).all(|(a, b)| (a - b).abs() < 0.02), "{found:?}");
    let again: ModelImport = post(&floor, client, "?into=gdb", zip).await.expect(200).data();
    assert_eq!(again.answer.unwrap().entry, None, "taken twice is taken once");
    let page: ImportPage = client.get(&floor.path(route::IMPORTS)).await.expect(200).data();
    assert_eq!(page.imports.len(), 0, "it is no prior");

    let folder = server.shutdown().await;
    std::fs::write(folder.path().join("map.yaml"), &yaml).unwrap();
    std::fs::write(folder.path().join("map.pgm"), &image).unwrap();
    let run = |words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mapfold-server"));
        command.args(words).arg("--data-dir").arg(folder.path().join("data"));
        let output = command.current_dir(folder.path()).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let told = run(&["import", "map.yaml", "--into-gdb", "--site", "plant", "--level", "floor"]);
    assert!(told.contains("2 wall") && told.contains("had all of it already"), "{told}");
}
