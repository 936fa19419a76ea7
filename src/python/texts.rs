//! How messages call arguments: their types, what they print as, their shapes.

use pyo3::prelude::*;

use super::error::OrRefuse;

/// The name of an object's type, for messages.
pub(super) fn type_name(object: &Bound<'_, PyAny>) -> String {
    object.get_type().name().map_or_else(|_| "an object".to_owned(), |name| name.to_string())
}

/// What an object prints as, for messages; of one that prints badly or at length, its type.
pub(super) fn text_of(object: &Bound<'_, PyAny>) -> PyResult<String> {
    const LONGEST: usize = 80;
    let text = object.repr().or_none(object.py())?.map(|text| text.to_string_lossy().into_owned());
    Ok(text.filter(|text| text.len() <= LONGEST).unwrap_or_else(|| type_name(object)))
}

/// A shape as Python writes it.
pub(super) fn tuple_text(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        _ => format!("({})", shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}
