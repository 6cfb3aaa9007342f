//! From rows of tables to values, with the table's name where one does not fit.

use sqlx::any::AnyRow;
use sqlx::{Any, Decode, Row, Type};

use super::StoreError;

/// The value in `column`. A null, or a value of another type, is a spoilt row.
pub(super) fn get<'r, T>(
    row: &'r AnyRow,
    table: &'static str,
    column: &'static str,
) -> Result<T, StoreError>
where
    T: Decode<'r, Any> + Type<Any>,
{
    row.try_get(column).map_err(|e| corrupt(table, column, e))
}

/// A spoilt row of `table`; `key` says which row, or which column of one.
pub(super) fn corrupt(
    table: &'static str,
    key: impl Into<String>,
    detail: impl std::fmt::Display,
) -> StoreError {
    StoreError::Corrupt { table, key: key.into(), detail: detail.to_string() }
}

/// A count that was written from a `u32`.
pub(super) fn count(
    row: &AnyRow,
    table: &'static str,
    column: &'static str,
) -> Result<u32, StoreError> {
    let value: i64 = get(row, table, column)?;
    u32::try_from(value).map_err(|e| corrupt(table, column, e))
}
