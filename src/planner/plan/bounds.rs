//! Bounds of the numbers of a configuration.

use crate::{Error, Result};

/// The error of an option whose value makes no sense.
pub(super) fn refused<T>(name: &str, value: impl std::fmt::Display, want: &str) -> Result<T> {
    Err(Error::request(format!("{name} is {value}; give {want}")))
}

/// Refuses numbers that are not positive.
pub(super) fn positive(numbers: &[(&str, f32)]) -> Result<()> {
    let wrong = numbers.iter().find(|(_, value)| !(value.is_finite() && *value > 0.0));
    wrong.map_or(Ok(()), |(name, value)| refused(name, value, "a positive number"))
}

/// Refuses numbers that are negative.
pub(super) fn not_negative(numbers: &[(&str, f32)]) -> Result<()> {
    let wrong = numbers.iter().find(|(_, value)| !(value.is_finite() && *value >= 0.0));
    wrong.map_or(Ok(()), |(name, value)| refused(name, value, "zero or a positive number"))
}
