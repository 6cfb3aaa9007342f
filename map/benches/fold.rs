//! How fast contributions are folded in and taken out, one at a time and many at once.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use mapfold_map::level::{Contribution, Level, LevelConfig};

#[path = "../tests/fold/world.rs"]
#[expect(dead_code, clippy::unwrap_used, reason = "shared with the tests, which use more of it")]
mod world;

fn folded(looks: &[Contribution]) -> Level {
    let mut level = Level::new(LevelConfig::standard(0.05));
    level.fold(looks);
    level
}

fn benches(c: &mut Criterion) {
    let looks = world::looks(1, 512, world::NOISE);
    let mut group = c.benchmark_group("fold");
    group.throughput(Throughput::Elements(512));
    group.bench_function("512 looks at once", |b| b.iter(|| black_box(folded(&looks))));
    group.throughput(Throughput::Elements(1));
    let before = folded(&looks[..511]);
    group.bench_function("one more look after 511", |b| {
        b.iter_batched_ref(
            || before.clone(),
            |level| black_box(level.fold(&looks[511..])),
            BatchSize::LargeInput,
        );
    });
    let after = folded(&looks);
    group.bench_function("one look of 512 taken out", |b| {
        b.iter_batched_ref(
            || after.clone(),
            |level| black_box(level.unfold(&looks[200..=200])),
            BatchSize::LargeInput,
        );
    });
    group.finish();
}

criterion_group!(fold, benches);
criterion_main!(fold);
