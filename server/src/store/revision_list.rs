//! The column that holds a list of revisions: unsigned LEB128 numbers, the first revision and then
//! the difference from each to the next. Neighbours of a log cost a byte each.

/// A column that [`encode`] did not write.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the list of revisions is damaged")]
pub struct Damaged;

/// The column of revisions that are positive and ascend.
pub fn encode(revisions: &[i64]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(revisions.len() + 8);
    let mut last = 0;
    for revision in revisions {
        let mut rest = (revision - last).unsigned_abs();
        last = *revision;
        while rest >= 0x80 {
            bytes.push((rest & 0x7f) as u8 | 0x80);
            rest >>= 7;
        }
        bytes.push(rest as u8);
    }
    bytes
}

/// The revisions of a column, ascending, each once.
///
/// # Errors
/// A column that [`encode`] did not write.
pub fn decode(column: &[u8]) -> Result<Vec<i64>, Damaged> {
    let mut revisions = Vec::with_capacity(column.len());
    let (mut last, mut step, mut shift) = (0_i64, 0_u64, 0_u32);
    for byte in column {
        let bits = u64::from(byte & 0x7f);
        if shift >= 63 || bits << shift >> shift != bits {
            return Err(Damaged);
        }
        step |= bits << shift;
        shift += 7;
        if byte & 0x80 == 0 {
            let step_by = i64::try_from(step).ok().filter(|step| *step > 0).ok_or(Damaged)?;
            last = last.checked_add(step_by).ok_or(Damaged)?;
            revisions.push(last);
            (step, shift) = (0, 0);
        }
    }
    if shift == 0 { Ok(revisions) } else { Err(Damaged) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_survives_its_column_and_neighbours_are_small() {
        for list in [&[][..], &[1], &[1, 2, 3, 130, 131, 1_000_000, i64::MAX], &[i64::MAX]] {
            assert_eq!(decode(&encode(list)), Ok(list.to_vec()));
        }
        let neighbours: Vec<i64> = (1_000_000..1_001_000).collect();
        assert_eq!(encode(&neighbours).len(), 1002);
    }

    #[test]
    fn a_damaged_column_is_refused() {
        for column in
            [&[0][..], &[5, 0], &[0x80], &[1, 0x80, 0x80], &[0xff; 12], &[0xff; 9], &[0x80; 40]]
        {
            assert_eq!(decode(column), Err(Damaged), "{column:?}");
        }
        let beyond = [encode(&[i64::MAX]), vec![1]].concat();
        assert_eq!(decode(&beyond), Err(Damaged));
    }
}
