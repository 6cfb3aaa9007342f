//! SQL for many rows at once, written out at compile time: `values ($1, $2), ($3, $4), ...`.
//!
//! Both engines take it, and the text stays a constant that no input can touch. Few large
//! statements are what makes both engines fast.

/// How many rows one statement of a [`Bulk`] holds, largest first.
pub(super) const SIZES: [usize; 4] = [64, 16, 4, 1];

/// One statement for each of [`SIZES`].
#[derive(Debug)]
pub(super) struct Bulk(pub(super) [&'static str; SIZES.len()]);

impl Bulk {
    /// Cuts `rows` into pieces, each with the statement that takes exactly so many.
    pub(super) fn statements<'s, 'r, T>(
        &'s self,
        mut rows: &'r [T],
    ) -> impl Iterator<Item = (&'static str, &'r [T])> + use<'s, 'r, T> {
        std::iter::from_fn(move || {
            let (text, size) = self.0.iter().zip(SIZES).find(|(_, size)| *size <= rows.len())?;
            let (piece, rest) = rows.split_at(size);
            rows = rest;
            Some((*text, piece))
        })
    }
}

const fn digits(mut number: usize) -> usize {
    let mut count = 1;
    while number >= 10 {
        number /= 10;
        count += 1;
    }
    count
}

/// Length of the text that [`write()`] writes.
pub(super) const fn length(
    before: &str,
    after: &str,
    first: usize,
    rows: usize,
    columns: usize,
) -> usize {
    let mut length = before.len() + after.len() + (rows - 1);
    let mut parameter = first;
    while parameter < first + rows * columns {
        length += 1 + digits(parameter);
        parameter += 1;
    }
    // Each row: two brackets and the commas between its columns.
    length + rows * (2 + columns - 1)
}

const fn copy<const N: usize>(mut to: [u8; N], mut at: usize, text: &str) -> ([u8; N], usize) {
    let bytes = text.as_bytes();
    let mut i = 0;
    while i < bytes.len() {
        to[at] = bytes[i];
        at += 1;
        i += 1;
    }
    (to, at)
}

/// `before`, then `rows` times `($first,...)` with `columns` parameters each, then `after`.
pub(super) const fn write<const N: usize>(
    before: &str,
    after: &str,
    first: usize,
    rows: usize,
    columns: usize,
) -> [u8; N] {
    let (mut to, mut at) = copy([0; N], 0, before);
    let mut parameter = first;
    let mut row = 0;
    while row < rows {
        if row > 0 {
            to[at] = b',';
            at += 1;
        }
        let mut column = 0;
        while column < columns {
            to[at] = if column == 0 { b'(' } else { b',' };
            to[at + 1] = b'$';
            let width = digits(parameter);
            let mut rest = parameter;
            let mut place = width;
            while place > 0 {
                to[at + 1 + place] = b'0' + (rest % 10) as u8;
                rest /= 10;
                place -= 1;
            }
            at += 2 + width;
            parameter += 1;
            column += 1;
        }
        to[at] = b')';
        at += 1;
        row += 1;
    }
    copy(to, at, after).0
}

/// The text `before ($first, ...), (...) after` as a constant.
macro_rules! with_values {
    ($before:expr, $rows:expr, $columns:expr, from $first:expr, $after:expr) => {{
        const LENGTH: usize =
            $crate::store::values::length($before, $after, $first, $rows, $columns);
        const BYTES: [u8; LENGTH] =
            $crate::store::values::write($before, $after, $first, $rows, $columns);
        const TEXT: &str = match std::str::from_utf8(&BYTES) {
            Ok(text) => text,
            Err(_) => panic!("SQL is UTF-8"),
        };
        TEXT
    }};
}

/// A [`Bulk`] of the same statement for each size.
macro_rules! bulk {
    ($before:expr, $columns:expr, from $first:expr, $after:expr) => {
        $crate::store::values::Bulk([
            $crate::store::values::with_values!($before, 64, $columns, from $first, $after),
            $crate::store::values::with_values!($before, 16, $columns, from $first, $after),
            $crate::store::values::with_values!($before, 4, $columns, from $first, $after),
            $crate::store::values::with_values!($before, 1, $columns, from $first, $after),
        ])
    };
}

/// A [`Bulk`] that looks for any of a list of values: `column in ($3,$4,...)`.
macro_rules! bulk_in {
    ($before:expr, from $first:expr, $after:expr) => {
        $crate::store::values::Bulk([
            $crate::store::values::with_values!($before, 1, 64, from $first, $after),
            $crate::store::values::with_values!($before, 1, 16, from $first, $after),
            $crate::store::values::with_values!($before, 1, 4, from $first, $after),
            $crate::store::values::with_values!($before, 1, 1, from $first, $after),
        ])
    };
}

pub(super) use {bulk, bulk_in, with_values};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_numbered_on_across_rows() {
        assert_eq!(
            with_values!("insert into t values ", 2, 3, from 9, " on conflict do nothing"),
            "insert into t values ($9,$10,$11),($12,$13,$14) on conflict do nothing"
        );
    }

    #[test]
    fn rows_are_cut_into_the_largest_statements_that_fit() {
        static BULK: Bulk = bulk!("values ", 2, from 1, "");
        let rows = [0_u8; 64 + 16 + 16 + 4 + 3];
        let sizes: Vec<usize> = BULK.statements(&rows).map(|(_, piece)| piece.len()).collect();
        assert_eq!(sizes, [64, 16, 16, 4, 1, 1, 1]);
        for (text, piece) in BULK.statements(&rows) {
            assert_eq!(text.matches('$').count(), 2 * piece.len());
        }
        assert_eq!(BULK.statements(&rows[..0]).count(), 0);
    }
}
