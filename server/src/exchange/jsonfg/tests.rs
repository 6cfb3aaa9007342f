//! A model out and in again, and documents that somebody or something has changed.

use proptest::prelude::*;
use serde_json::{Value, json};

use super::super::sample::{FRAME, Sample, changed, model_of, plans};
use super::*;

fn written() -> Vec<u8> {
    let mut bytes = Vec::new();
    write(Sample::new().outgoing(), &mut bytes).unwrap();
    bytes
}

/// What must be so whatever a document says: it is taken and can be cut, or refused with a place and a reason.
fn held(bytes: &[u8]) -> Result<(), TestCaseError> {
    match read(bytes, FRAME, &BTreeMap::new()) {
        Ok(incoming) => drop(plans(&model_of(&incoming))),
        Err(fault) => prop_assert!(!fault.place.is_empty() && !fault.fault.is_empty(), "{fault:?}"),
    }
    Ok(())
}

/// Values that numbers, words and lists of a document are replaced by.
fn values() -> impl Strategy<Value = Value> {
    prop_oneof![
        Just(json!(null)),
        any::<bool>().prop_map(|b| json!(b)),
        any::<f64>().prop_map(|number| json!(number)),
        any::<i64>().prop_map(|number| json!(number)),
        prop::sample::select(vec![1e-300, -0.0, 1e9, 1e308, 0.000_000_1]).prop_map(|n| json!(n)),
        ".{0,9}".prop_map(|text| json!(text)),
        prop::sample::select(vec!["wall", "doorway", "table 1.6 \"m\"", "TABLE 1.6 'm'", "nobody"])
            .prop_map(|word| json!(word)),
        Just(json!([])),
        Just(json!({})),
        (1..200_usize).prop_map(|depth| { (0..depth).fold(json!(0), |inner, _| json!([inner])) }),
        (1..50_usize).prop_map(|count| json!(vec![[0.0, 1.0, 2.0]; count])),
    ]
}

/// Puts a value in the place of the `number`th of a document's.
fn put(document: &mut Value, number: &mut usize, new: &Value) -> bool {
    if *number == 0 {
        *document = new.clone();
        return true;
    }
    *number -= 1;
    match document {
        Value::Array(items) => items.iter_mut().any(|item| put(item, number, new)),
        Value::Object(members) => members.values_mut().any(|item| put(item, number, new)),
        _ => false,
    }
}

fn size(document: &Value) -> usize {
    1 + match document {
        Value::Array(items) => items.iter().map(size).sum(),
        Value::Object(members) => members.values().map(size).sum(),
        _ => 0,
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, ..ProptestConfig::default() })]

    #[test]
    fn documents_with_changed_bytes_are_read_or_refused(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..5_u8), 1..6),
    ) {
        let mut bytes = written();
        changed(&mut bytes, &edits);
        held(&bytes)?;
    }

    /// Well-formed JSON all of it: what is wrong is what it says.
    #[test]
    fn documents_with_other_values_are_read_or_refused(
        edits in prop::collection::vec((any::<prop::sample::Index>(), values()), 1..4),
    ) {
        let mut document: Value = serde_json::from_slice(&written()).unwrap();
        for (at, value) in &edits {
            // The document as a whole is replaced by the test of bytes.
            let mut number = 1 + at.index(size(&document) - 1);
            prop_assert!(put(&mut document, &mut number, value));
        }
        held(document.to_string().as_bytes())?;
    }

    #[test]
    fn documents_that_end_anywhere_are_refused(at: prop::sample::Index) {
        let bytes = written();
        let fault = read(&bytes[..at.index(bytes.len())], FRAME, &BTreeMap::new()).unwrap_err();
        prop_assert!(!fault.place.is_empty() && !fault.fault.is_empty());
    }
}

/// What is wrong before anything can be named is wrong with the document.
#[test]
fn text_that_is_none_is_refused_with_a_place() {
    for bytes in [
        &b"{\"\xff\":0}"[..],
        b"{\"type\":\"\xff\"}",
        b"{\"features\":[{\"id\":\"\xff\"}]}",
        b"[]",
        b"7",
    ] {
        let fault = read(bytes, FRAME, &BTreeMap::new()).unwrap_err();
        assert!(!fault.place.is_empty() && !fault.fault.is_empty(), "{fault:?}");
    }
}

#[test]
fn deep_documents_are_refused() {
    for open in ["[", "{\"a\":", "{\"type\":\"FeatureCollection\",\"features\":["] {
        let fault = read(open.repeat(200_000).as_bytes(), FRAME, &BTreeMap::new()).unwrap_err();
        assert!(!fault.place.is_empty() && !fault.fault.is_empty(), "{fault:?}");
    }
}
