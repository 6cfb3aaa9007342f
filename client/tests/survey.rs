//! Surveying the logs that the repository holds: every contribution must pass the server's border,
//! be the same every time, and say about the scans what the scans say.
#![expect(clippy::unwrap_used, reason = "tests stop at the first surprise")]

use std::collections::BTreeSet;
use std::path::PathBuf;

use mapfold_client::emulation::{Chance, EmulationConfig, emulate};
use mapfold_client::log::{Log, Observation, ScannerMake, carmen};
use mapfold_client::perception::{self, BeamUse};
use mapfold_client::robot::{Look, Passed, PoseSd, PoseSource, Surveyor, SurveyorConfig};
use mapfold_client::sensor::{Ring, Sensors, preset};
use mapfold_map::level::Provenance;
use mapfold_map::raster::SensorClass;
use mapfold_schema::border::{DEFAULT_LIMITS, Target, check_contribution};
use mapfold_schema::codec::to_cbor;
use mapfold_schema::v1::RangeCorrection;
use proptest::prelude::*;
use uuid::Uuid;

const FRAME: Uuid = Uuid::from_u128(7);

fn log(name: &str) -> Log {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/data");
    carmen::read(folder.join(name)).unwrap()
}

fn config(log: &Log, sensors: Sensors) -> SurveyorConfig {
    SurveyorConfig::of_log("anna", sensors, log, 0.05)
}

fn survey(log: &Log, config: &SurveyorConfig) -> Vec<Look> {
    let mut surveyor = Surveyor::new(config.clone(), 0).unwrap();
    log.readings.iter().filter_map(|reading| surveyor.survey(reading).ok()).collect()
}

fn assert_valid(looks: &[Look]) {
    let target = Target { frame: FRAME, resolution_m: 0.05, limits: DEFAULT_LIMITS };
    for look in looks {
        let back = check_contribution(&look.to_wire(FRAME), &target).unwrap();
        assert_eq!(back.segments.len(), look.contribution.segments.len());
        assert_eq!(back.evidence, look.contribution.evidence);
        let id = Uuid::from_bytes(look.contribution.id.0);
        assert_eq!(id.get_version_num(), 7);
    }
    let ids: BTreeSet<_> = looks.iter().map(|l| l.contribution.id).collect();
    assert_eq!(ids.len(), looks.len(), "ids are distinct");
}

#[test]
fn killian_gives_a_valid_contribution_a_scan_and_the_same_every_time() {
    let mut log = log("killian.log.gz");
    assert_eq!((log.readings.len(), log.summary.scans, log.summary.malformed), (3873, 3873, 0));
    assert_eq!(log.scanner, Some(ScannerMake::SickPls));
    let config = config(&log, preset("sick-pls").unwrap());
    let looks = survey(&log, &config);
    assert_eq!(looks.len(), 3873);
    assert_valid(&looks);
    log.readings.truncate(300);
    let looks = &looks[..300];
    let wire = |looks: &[Look]| -> Vec<Vec<u8>> {
        looks.iter().map(|l| to_cbor(&l.to_wire(FRAME)).unwrap()).collect()
    };
    assert_eq!(wire(looks), wire(&survey(&log, &config)));
    // Another robot, or another certainty, is another contribution; the level's frame is not.
    let id =
        |config: &SurveyorConfig| Surveyor::new(config.clone(), 0).unwrap().id(&log.readings[5]);
    let other = SurveyorConfig { robot: "bruno".to_owned(), ..config.clone() };
    assert_ne!(id(&config), id(&other));
    let pose_sd = PoseSd { position_m: 0.05, ..PoseSd::CORRECTED_LOG };
    assert_ne!(id(&config), id(&SurveyorConfig { pose_sd, ..config.clone() }));
}

#[test]
fn most_of_what_killian_saw_is_explained_by_walls_and_clusters() {
    let log = log("killian.log.gz");
    let profile = preset("sick-pls").unwrap().scanner.unwrap();
    let config = perception::Config::for_scanner(&profile);
    let (mut walls, mut on_wall, mut in_cluster, mut points) = (0, 0, 0, 0);
    for reading in log.readings.iter().step_by(10) {
        let Observation::Scan(scan) = &reading.observation else { panic!("not a scan") };
        let found = perception::extract(scan, &config);
        walls += found.segments.len();
        for beam in found.beams {
            points += i32::from(!matches!(beam, BeamUse::NoPoint(_)));
            on_wall += i32::from(matches!(beam, BeamUse::Segment(_)));
            in_cluster += i32::from(matches!(beam, BeamUse::Cluster(_)));
        }
    }
    let share = |n: i32| f64::from(n) / f64::from(points);
    assert!((4..9).contains(&(walls / 388)), "{walls} walls in 388 scans");
    assert!(share(on_wall) > 0.75, "on walls: {}", share(on_wall));
    assert!(share(on_wall + in_cluster) > 0.88, "explained: {}", share(on_wall + in_cluster));
}

#[test]
fn a_scanner_that_is_corrected_otherwise_gives_other_contributions() {
    let log = log("killian.log.gz");
    let corrected = |bias_m: f64| {
        let mut sensors = preset("sick-pls").unwrap();
        sensors.scanner.as_mut().unwrap().correction = Some(RangeCorrection {
            distances_m: vec![0.5, 50.0],
            incidences_rad: vec![0.0],
            bias_m: vec![vec![bias_m; 2]],
            sd_m: vec![vec![0.01; 2]],
            incidence_max_rad: 0.0,
        });
        Surveyor::new(config(&log, sensors), 0).unwrap().id(&log.readings[0])
    };
    assert_eq!(corrected(0.02), corrected(0.02));
    assert_ne!(corrected(0.02), corrected(0.03));
}

#[test]
fn a_real_ring_of_sonars_gives_evidence_only() {
    let log = log("corridor-ring8.log.gz");
    let looks = survey(&log, &config(&log, preset("sonar-ring").unwrap()));
    assert_eq!(looks.len(), 413);
    assert_valid(&looks);
    for look in &looks {
        let c = &look.contribution;
        assert!(c.segments.is_empty() && c.clusters.is_empty() && !look.emulated);
        assert!(c.evidence.iter().all(|e| e.class == SensorClass::Sonar));
    }
    assert!(looks.iter().filter(|l| !l.contribution.evidence.is_empty()).count() > 400);
}

#[test]
fn emulated_sonar_is_as_silent_as_the_real_ring() {
    let silent = |rings: &[Ring]| {
        let sonars = || rings.iter().flat_map(|ring| &ring.sonars);
        sonars().filter(|s| s.range.is_none()).count() as f64 / sonars().count() as f64
    };
    let profile = preset("sonar-ring").unwrap().sonar.unwrap();
    let (mut real, mut emulated) = (Vec::new(), Vec::new());
    for reading in log("corridor-ring8.log.gz").readings {
        let Observation::Ring(mut ring) = reading.observation else { continue };
        for sonar in &mut ring.sonars {
            sonar.range = sonar.range.filter(|r| *r < profile.range_max_m);
        }
        real.push(ring);
    }
    for reading in log("killian.log.gz").readings.iter().step_by(10) {
        let Observation::Scan(scan) = &reading.observation else { continue };
        let mut chance = Chance::new(u64::from(reading.index));
        emulated.push(emulate(scan, &profile, &EmulationConfig::STANDARD, &mut chance));
    }
    let (real, emulated) = (silent(&real), silent(&emulated));
    assert!((real - 0.33).abs() < 0.02, "{real}");
    assert!((emulated - real).abs() < 0.1, "emulated {emulated}, real {real}");
}

#[test]
fn emulated_sonar_says_so_and_is_the_same_every_time() {
    let mut log = log("killian.log.gz");
    log.readings.truncate(200);
    let emulated =
        SurveyorConfig { emulate_sonar: true, ..config(&log, preset("sonar-ring").unwrap()) };
    let looks = survey(&log, &emulated);
    assert_valid(&looks);
    assert!(looks.iter().all(|l| l.emulated && l.contribution.segments.is_empty()));
    assert_eq!(looks, survey(&log, &emulated));
}

#[test]
fn dead_reckoning_ends_where_it_says_nothing_any_more() {
    // A robot that drives straight on for 2 km, a scan of one wall every 10 m.
    let lines: Vec<String> =
        (0..200).map(|i| format!("FLASER 3 2 2 2 0 0 0 {} 0 0 {i} h 0\n", 10 * i)).collect();
    let log = carmen::read_from(std::io::Cursor::new(lines.concat().into_bytes())).unwrap();
    let config =
        SurveyorConfig { poses: PoseSource::Odometry, ..config(&log, preset("sick-lms").unwrap()) };
    let looks = survey(&log, &config);
    assert_valid(&looks);
    // Half a radian at one degree a root metre: 820 m.
    assert_eq!(looks.len(), 83);
    assert!(looks.iter().all(|l| l.contribution.provenance == Provenance::Odometry));
    let mut surveyor = Surveyor::new(config, 0).unwrap();
    let last = log.readings.iter().map(|r| surveyor.survey(r)).last().unwrap();
    assert_eq!(last, Err(Passed::Lost));
}

#[test]
fn readings_without_what_the_surveyor_needs_are_passed_over_with_a_reason() {
    let killian = log("killian.log.gz");
    let mut config = config(&killian, preset("sick-pls").unwrap());
    config.poses = PoseSource::Odometry;
    let mut surveyor = Surveyor::new(config.clone(), 0).unwrap();
    assert_eq!(surveyor.survey(&killian.readings[0]), Err(Passed::NoOdometry));
    config.sensors = preset("sonar-ring").unwrap();
    let mut surveyor = Surveyor::new(config, 0).unwrap();
    assert_eq!(surveyor.survey(&killian.readings[0]), Err(Passed::OtherSensor));
}

/// One range: mostly somewhere in a room, sometimes what broken sensors give.
fn range() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => 0.05..12.0,
        2 => 1.9..2.1,
        1 => prop_oneof![
            Just(0.0), Just(-1.0), Just(50.0), Just(1e300), Just(f64::NAN), Just(f64::INFINITY),
            Just(1e-12), Just(f64::MIN_POSITIVE)
        ],
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn whatever_a_scanner_gives_the_server_takes(
        ranges in prop::collection::vec(range(), 0..400),
        (x, y, heading) in (-500.0..500.0, -500.0..500.0, -4.0..4.0),
        (mount_x, mount_heading) in (-1.0..1.0, -4.0..4.0),
    ) {
        let ranges: Vec<String> = ranges.iter().map(f64::to_string).collect();
        // The scanner's own pose, ahead of the robot's and turned.
        let line = format!(
            "ROBOTLASER1 0 -3.14159265 6.2831853 {} 50 0.1 0 {} {} 0 {} {y} {} {x} {y} {heading} \
             0 0 0 0 0 7 h 7\n",
            std::f64::consts::TAU / ranges.len().max(8) as f64,
            ranges.len(),
            ranges.join(" "),
            x + mount_x,
            heading + mount_heading,
        );
        let log = carmen::read_from(std::io::Cursor::new(line.into_bytes())).unwrap();
        assert_valid(&survey(&log, &config(&log, preset("sick-lms").unwrap())));
        let emulated =
            SurveyorConfig { emulate_sonar: true, ..config(&log, preset("sonar-ring").unwrap()) };
        assert_valid(&survey(&log, &emulated));
    }

    #[test]
    fn whatever_a_log_holds_reading_it_ends_well(
        bytes in prop::collection::vec(any::<u8>(), 0..300),
        lines in prop::collection::vec("(FLASER|ODOM|SONAR|ROBOTLASER1|PARAM|#)( -?[0-9e.]{1,6}| nan){0,20}", 0..20),
    ) {
        let read = |bytes: Vec<u8>| carmen::read_from(std::io::Cursor::new(bytes));
        let _ = read(bytes.clone());
        let _ = read([&[0x1f, 0x8b], bytes.as_slice()].concat());
        if let Ok(log) = read(lines.join("\n").into_bytes()) {
            prop_assert!(log.readings.len() as u64 == log.summary.scans + log.summary.rings);
        }
    }
}
