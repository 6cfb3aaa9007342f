//! Errors of many readings in few figures.

use std::collections::BTreeMap;

use super::{BIN, Sample};

/// Errors in short, metres.
#[derive(Debug, Clone, Copy, Default)]
pub struct Errors {
    /// How many.
    pub count: usize,
    /// Mean.
    pub bias: f64,
    /// Standard deviation.
    pub sd: f64,
    /// 99 of 100 are smaller.
    pub p99: f64,
    /// The greatest.
    pub max: f64,
}

impl Errors {
    /// Of these.
    pub fn of(errors: impl Iterator<Item = f64>) -> Self {
        let errors: Vec<f64> = errors.collect();
        let count = errors.len() as f64;
        if errors.is_empty() {
            return Self::default();
        }
        let bias = errors.iter().sum::<f64>() / count;
        let mut sizes: Vec<f64> = errors.iter().map(|e| e.abs()).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        Self {
            count: errors.len(),
            bias,
            sd: (errors.iter().map(|e| (e - bias).powi(2)).sum::<f64>() / count).sqrt(),
            p99: sizes[((0.99 * count) as usize).min(sizes.len() - 1)],
            max: sizes[sizes.len() - 1],
        }
    }
}

/// The bin of greatest bias after correction in the scan, of those with readings enough: distance
/// and incidence (degrees) of its middle, its errors.
pub fn worst_bin(samples: &[Sample], enough: usize) -> Option<(f64, f64, Errors)> {
    let mut bins: BTreeMap<(u32, u32), Vec<f64>> = BTreeMap::new();
    for sample in samples {
        if let Some(error) = sample.in_situ {
            let bin = ((sample.distance / BIN.0) as u32, (sample.incidence_deg / BIN.1) as u32);
            bins.entry(bin).or_default().push(error);
        }
    }
    bins.into_iter()
        .filter(|(_, errors)| errors.len() >= enough)
        .map(|((d, beta), errors)| {
            let middle = (BIN.0 * (f64::from(d) + 0.5), BIN.1 * (f64::from(beta) + 0.5));
            (middle.0, middle.1, Errors::of(errors.into_iter()))
        })
        .max_by(|a, b| a.2.bias.abs().total_cmp(&b.2.bias.abs()))
}
