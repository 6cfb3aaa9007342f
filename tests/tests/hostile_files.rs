//! Corrupt, huge and hostile files of every format, sent to a real server process: each is refused with a clear problem, or told
//! for what it is, everybody else is answered meanwhile, and the memory of the process stays bounded.
//!
//! The work that a file may cause is bounded by counts (entities, vertices, pairs, pixels, crossings), which the tests of the
//! readers hold; here no time is asserted, for this machine may be busy.

#![expect(clippy::expect_used, reason = "tests may stop at the first surprise")]

use std::io::Write as _;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

use flate2::write::DeflateEncoder;
use flate2::{Compression, Crc};
use mapfold_schema::problem::{PROBLEM_JSON, Problem};
use mapfold_schema::route;
use mapfold_schema::v1::SiteDescription;
use mapfold_tests::Error;
use mapfold_tests::database::Database;
use mapfold_tests::level::Level;
use mapfold_tests::server::Server;

const YAML: &str = "application/yaml";
const DXF: &str = "image/vnd.dxf";
const GLB: &str = "model/gltf-binary";
const FG: &str = "application/fg+json";
const GEO: &str = "application/geo+json";
const ZIP: &str = "application/zip";

/// What the process may take, kilobytes: some hundred times the largest of these files.
const MEMORY_MAX_KB: u64 = 700_000;
/// The default limit of a body on the wire.
const WIRE_BYTES: usize = 4 << 20;

/// A file, and what its problem must say.
struct File {
    name: &'static str,
    media_type: &'static str,
    bytes: Vec<u8>,
    status: u16,
    /// A word that the problem's text must have; any if empty.
    word: &'static str,
}

fn file(
    name: &'static str,
    media_type: &'static str,
    bytes: impl Into<Vec<u8>>,
    word: &'static str,
) -> File {
    File { name, media_type, bytes: bytes.into(), status: 422, word }
}

fn buildings() -> Vec<File> {
    let level = |walls: &str, vertices: &str| {
        format!(
            "name: b\nlevels:\n  L1:\n    elevation: 0\n    vertices: [{vertices}]\n    walls: [{walls}]\n    measurements: [[0, 1, {{distance: [3, 1.0]}}]]\n"
        )
    };
    let laugh =
        |k: u32| format!("a{}: &a{} [*a{k}, *a{k}, *a{k}, *a{k}, *a{k}, *a{k}]", k + 1, k + 1);
    let laughs = (0..30).map(laugh).collect::<Vec<String>>().join("\n");
    vec![
        file("deep lists", YAML, "[".repeat(1 << 20), ""),
        file("aliases of aliases", YAML, format!("a0: &a0 [x]\n{laughs}"), "references"),
        file("a scale of nothing", YAML, level("[0, 1, {}]", "[0, 0], [0, 0]"), "measurement"),
        file("a wall to nowhere", YAML, level("[0, 70000, {}]", "[0, 0], [1, 0]"), "vertices"),
        File {
            status: 200,
            ..file(
                "numbers without end",
                YAML,
                level("[0, 1, {}]", "[1e308, 0], [-1e308, 0]"),
                "without length",
            )
        },
        file("no text", YAML, vec![0xff; 4096], ""),
        file("a million numbers", YAML, format!("a: [{}]", "1,".repeat(1_500_000)), ""),
    ]
}

fn drawings() -> Vec<File> {
    let drawing = |blocks: &str, entities: &str| {
        format!(
            "0\nSECTION\n2\nBLOCKS\n{blocks}0\nENDSEC\n0\nSECTION\n2\nENTITIES\n{entities}0\nENDSEC\n0\nEOF\n"
        )
    };
    let block = |name: usize, inside: &str| {
        format!("0\nBLOCK\n2\nB{name}\n10\n0\n20\n0\n{inside}0\nENDBLK\n")
    };
    let insert = |name: usize| format!("0\nINSERT\n8\nA-WALL\n2\nB{name}\n10\n0\n20\n0\n");
    let line = "0\nLINE\n8\nA-WALL\n10\n0\n20\n0\n11\n1\n21\n0\n";
    // Each block holds ten of the next one.
    let tower: String =
        (0..14).map(|k| block(k, &insert(k + 1).repeat(10))).chain([block(14, line)]).collect();
    vec![
        file("no drawing", DXF, vec![b'x'; 1 << 20], ""),
        file("a binary drawing", DXF, b"AutoCAD Binary DXF\r\n\x1a\0rest".to_vec(), "ASCII"),
        file("a drawing cut off", DXF, &drawing("", &line.repeat(9))[..200], ""),
        file("blocks of ten of blocks", DXF, drawing(&tower, &insert(0)), ""),
        file("a block in itself", DXF, drawing(&block(0, &insert(0)), &insert(0)), ""),
        file("numbers without end", DXF, drawing("", &line.replace("11\n1\n", "11\n1e300\n")), ""),
    ]
}

fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend(((12 + 8 + json.len() + 8 + binary.len()) as u32).to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(json);
    bytes.extend((binary.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(binary);
    bytes
}

fn models() -> Vec<File> {
    let scene = |nodes: &str, rest: &str| {
        format!(
            "{{\"asset\":{{\"version\":\"2.0\"}},\"scene\":0,\"scenes\":[{{\"nodes\":[0]}}],\"nodes\":[{nodes}]{rest}}}"
        )
    };
    let mesh = |count: u64, more: &str| {
        format!(
            ",\"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0}}}}]}}],\"accessors\":[{{\"componentType\":5126,\"type\":\"VEC3\",\"count\":{count},\"bufferView\":0{more}}}],\"bufferViews\":[{{\"buffer\":0,\"byteLength\":48}}],\"buffers\":[{{\"byteLength\":48}}]"
        )
    };
    let tower: Vec<String> =
        (1..40).map(|k| format!("{{\"children\":[{k},{k},{k},{k}]}}")).collect();
    let tower = scene(&format!("{},{{\"mesh\":0}}", tower.join(",")), &mesh(4, ""));
    let cycle = scene("{\"children\":[0],\"mesh\":0}", &mesh(4, ""));
    let vast = scene("{\"mesh\":0}", &mesh(4_000_000_000, ""));
    let outside = scene("{\"mesh\":0}", &mesh(4, ""))
        .replace("{\"byteLength\":48}]", "{\"byteLength\":48,\"uri\":\"http://127.0.0.1/x\"}]");
    let mut lies = glb(&scene("{\"mesh\":0}", &mesh(4, "")), &[0; 48]);
    lies[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    vec![
        file("no model", GLB, vec![0; 1 << 20], ""),
        file("a chunk that lies", GLB, lies, ""),
        file("deep JSON", GLB, glb(&"[".repeat(1 << 20), &[]), ""),
        file("nodes of four of nodes", GLB, glb(&tower, &[0; 48]), ""),
        file("a node in itself", GLB, glb(&cycle, &[0; 48]), ""),
        file("four thousand million vertices", GLB, glb(&vast, &[0; 48]), ""),
        file("a buffer elsewhere", GLB, glb(&outside, &[0; 48]), ""),
        File {
            status: 413,
            ..file("more than may be sent", GLB, vec![0; WIRE_BYTES + 1], "upload_compressed_bytes")
        },
    ]
}

fn documents() -> Vec<File> {
    let document =
        |features: &str| format!("{{\"type\":\"FeatureCollection\",\"features\":[{features}]}}");
    let boxed = |number: usize, to: &str| {
        format!(
            "{{\"type\":\"Feature\",\"id\":\"0190{number:04x}-0000-7000-8000-000000000000\",\"geometry\":null,\"properties\":{{\"kind\":\"wall\",\"solids\":[{{\"box\":{{\"from_m\":[0,0,0],\"to_m\":{to}}}}}]}}}}"
        )
    };
    let many: Vec<String> = (0..9).map(|_| boxed(1, "[1,1,1]")).collect();
    let ring: Vec<String> = (0..60_000).map(|k| format!("[{},{}]", k % 7, k % 11)).collect();
    let tangled = boxed(1, "[1,1,1]").replace(
        "{\"box\":{\"from_m\":[0,0,0],\"to_m\":[1,1,1]}}",
        &format!("{{\"prism\":{{\"base_m\":[[{}]],\"lower_m\":0,\"upper_m\":1}}}}", ring.join(",")),
    );
    vec![
        file("deep JSON", FG, "[".repeat(1 << 20), ""),
        file("cut off", FG, &document(&boxed(1, "[1,1,1]"))[..90], ""),
        file("a box without end", FG, document(&boxed(1, "[1e300,1,1]")), ""),
        file("one identity nine times", FG, document(&many.join(",")), ""),
        // Drafts may have faults; they are named.
        File {
            status: 200,
            ..file("a tangle of 60 000 corners", FG, document(&tangled), "meets_itself")
        },
    ]
}

fn plans() -> Vec<File> {
    let plan = |frame: &str, features: &str| {
        format!("{{\"type\":\"FeatureCollection\",{frame}\"features\":[{features}]}}")
    };
    let metres = "\"coordinate_frame\":{\"unit\":\"m\"},";
    let feature = |kind: &str, coordinates: &str, properties: &str| {
        format!(
            "{{\"type\":\"Feature\",\"geometry\":{{\"type\":\"{kind}\",\"coordinates\":{coordinates}}},\"properties\":{{{properties}}}}}"
        )
    };
    let line = feature("LineString", "[[0,0],[40,30]]", "");
    let ring: Vec<String> = (0..60_000).map(|k| format!("[{},{}]", k % 7, k % 11)).collect();
    let tangled = format!("[[{},[0,0]]]", ring.join(","));
    let obstacle = "\"kind\":\"gdb\",\"shape\":\"obstacle\"";
    let tangled = feature("Polygon", &tangled, obstacle);
    let far = feature("LineString", "[[0,0],[1e300,0]]", "");
    vec![
        file("deep lists", GEO, "[".repeat(1 << 20), ""),
        file(
            "deep coordinates",
            GEO,
            plan(metres, &feature("Polygon", &"[".repeat(1 << 20), "")),
            "",
        ),
        file("a wall across continents", GEO, plan("", &line), "unit_m"),
        file("a wall without end", GEO, plan(metres, &far), ""),
        file("a million features", GEO, plan(metres, &vec!["{}"; 1_000_000].join(",")), "200000"),
        // Drafts may have faults; they are named.
        File {
            status: 200,
            ..file("a tangled outline", GEO, plan(metres, &tangled), "meets_itself")
        },
    ]
}

fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes).expect("a vector takes it");
    encoder.finish().expect("a vector takes it")
}

/// A zip of files, each with the length that it claims to have unpacked.
fn zip(files: &[(&str, &[u8], u32)]) -> Vec<u8> {
    let (mut out, mut directory): (Vec<u8>, Vec<u8>) = (Vec::new(), Vec::new());
    for (name, bytes, claimed) in files {
        let (offset, packed) = (out.len() as u32, deflated(bytes));
        let mut crc = Crc::new();
        crc.update(bytes);
        let mut common = vec![20, 0, 0, 0, 8, 0, 0, 0, 0, 0];
        common.extend(crc.sum().to_le_bytes());
        common.extend((packed.len() as u32).to_le_bytes());
        common.extend(claimed.to_le_bytes());
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        out.extend(b"PK\x03\x04".iter().chain(&common).chain(name.as_bytes()).chain(&packed));
        directory.extend(b"PK\x01\x02\x14\0".iter().chain(&common).chain(&[0; 10]));
        directory.extend(offset.to_le_bytes().iter().chain(name.as_bytes()));
    }
    let (offset, count, size) = (out.len() as u32, files.len() as u16, directory.len() as u32);
    out.extend(directory);
    out.extend(b"PK\x05\x06\0\0\0\0");
    out.extend(count.to_le_bytes().into_iter().chain(count.to_le_bytes()));
    out.extend(size.to_le_bytes().into_iter().chain(offset.to_le_bytes()));
    out.extend([0, 0]);
    out
}

fn maps() -> Vec<File> {
    let description = b"image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
    let map = |name: &str, image: &[u8], claimed: u32| {
        let text = String::from_utf8_lossy(description).replace("map.pgm", name).into_bytes();
        zip(&[("map.yaml", &text, text.len() as u32), (name, image, claimed)])
    };
    let bomb = vec![0; 1 << 28];
    let huge = b"P5\n60000 60000\n255\n\0\0\0".to_vec();
    let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec();
    png.extend([0, 0, 0xff, 0xff, 0, 0, 0xff, 0xff, 8, 0, 0, 0, 0]);
    let mut crc = Crc::new();
    crc.update(&png[12..]);
    png.extend(crc.sum().to_be_bytes());
    let sound = b"P5\n2 2\n255\n\0\0\0\0".to_vec();
    let mut cut = map("map.pgm", &sound, sound.len() as u32);
    cut.truncate(cut.len() - 30);
    vec![
        file("no zip", ZIP, vec![7; 1 << 20], ""),
        file("a zip cut off", ZIP, cut, ""),
        file("a bomb", ZIP, map("map.pgm", &bomb, 1 << 28), "bytes"),
        file("a bomb that lies", ZIP, map("map.pgm", &bomb, 99), ""),
        file("an image of 3600 million pixels", ZIP, map("map.pgm", &huge, huge.len() as u32), ""),
        file("a PNG of 4295 million pixels", ZIP, map("map.png", &png, png.len() as u32), "pixels"),
        file("no map in it", ZIP, zip(&[("readme", b"hello", 5)]), ""),
    ]
}

#[tokio::test(flavor = "multi_thread")]
async fn no_file_harms_a_server() -> Result<(), Error> {
    let server = Server::start(Database::Sqlite).await?;
    let level = Level::create(server.api()?, "plant", "floor").await?;
    let files =
        [buildings(), drawings(), models(), documents(), plans(), maps()].into_iter().flatten();
    let path = level.path(route::IMPORTS);
    let (done, others) = (AtomicBool::new(false), AtomicU32::new(0));
    let asking = async {
        // Somebody else, all the time.
        while !done.load(Ordering::Relaxed) {
            let _: Vec<SiteDescription> = level.api.fetch(route::SITES).await?;
            others.fetch_add(1, Ordering::Relaxed);
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        Ok::<(), Error>(())
    };
    let sending = async {
        let mut wrong = Vec::new();
        for File { name, media_type, bytes, status, word } in files {
            let (kilobytes, before) = (bytes.len() >> 10, others.load(Ordering::Relaxed));
            let query = match media_type {
                ZIP => "?preview=true&into=gdb",
                DXF => "?preview=true&unit_m=1",
                _ => "?preview=true",
            };
            let answer = level.api.post(&format!("{path}{query}"), media_type, bytes).await?;
            let (now, most) = (server.memory_kb("VmRSS")?, server.memory_kb("VmHWM")?);
            let asked = others.load(Ordering::Relaxed) - before;
            let told = answer.text();
            println!(
                "{name} ({media_type}, {kilobytes} kB): {} {told}; {asked} others; {now} of {most} kB",
                answer.status
            );
            let problem: Option<Problem> = answer.decode_any().ok();
            let is_clear = if status == 200 {
                String::from_utf8_lossy(&answer.body).contains(word)
            } else {
                answer.content_type.starts_with(PROBLEM_JSON)
                    && problem.is_some_and(|p| p.detail.len() > 20 && p.detail.contains(word))
            };
            if answer.status != status || !is_clear {
                wrong.push(format!("{name} ({media_type}): {} {told}", answer.status));
            }
            assert!(most < MEMORY_MAX_KB, "{name}: {most} kB");
        }
        done.store(true, Ordering::Relaxed);
        Ok::<Vec<String>, Error>(wrong)
    };
    let (asked, wrong) = tokio::join!(asking, sending);
    asked?;
    let wrong = wrong?;
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(others.load(Ordering::Relaxed) > 0);
    Ok(())
}
