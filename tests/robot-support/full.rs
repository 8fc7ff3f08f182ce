//! Reduced and full numbers of test cases.

/// Checks whether all cases are requested: `TEST_ALL=1` in the environment.
#[must_use]
pub fn all_cases() -> bool {
    std::env::var_os("TEST_ALL").is_some_and(|value| value == "1")
}
