//! Medians: what a few wrong readings cannot move.

/// A normal distribution's standard deviation in median absolute deviations (Hampel 1974).
pub(crate) const SD_PER_MEDIAN_DEVIATION: f64 = 1.4826;

/// The two in the middle of sorted values, or the one in the middle twice; `None` of nothing.
pub(crate) fn middle(sorted: &[f64]) -> Option<[f64; 2]> {
    let lower = *sorted.get(sorted.len().checked_sub(1)? / 2)?;
    Some([lower, *sorted.get(sorted.len() / 2)?])
}

/// The median of sorted values; `None` of nothing.
pub(crate) fn median(sorted: &[f64]) -> Option<f64> {
    middle(sorted).map(|[lower, upper]| f64::midpoint(lower, upper))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_the_middle_one_or_between_the_two() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[3.0]), Some(3.0));
        assert_eq!(middle(&[1.0, 2.0, 9.0]), Some([2.0, 2.0]));
        assert_eq!(median(&[1.0, 2.0, 3.0, 9.0]), Some(2.5));
    }
}
