//! Code paths: identical results with the instructions of different processors.

#[cfg(target_arch = "x86_64")]
use super::x86;

/// Environment variable that forces a path: `portable`, `avx2` or `avx512`.
pub const PATH_VARIABLE: &str = "MINIMAL_SURPRISE_PATH";

/// The instruction set that the fast engine uses. All paths give the same results.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EnginePath {
    /// Instructions that every processor has.
    Portable,
    /// AVX2: predicts for 16 robots at once.
    #[cfg(target_arch = "x86_64")]
    Avx2(x86::Avx2),
    /// AVX-512 with its extensions up to Ice Lake and Zen 4: predicts for 32 robots at once, and
    /// senses and decides for 16.
    #[cfg(target_arch = "x86_64")]
    Avx512(x86::Avx512),
}

/// Error: the name of a path is unknown, or this processor does not support the path.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{PATH_VARIABLE} names the path {0:?}; this processor has {list}", list = EnginePath::names())]
pub struct PathError(String);

impl EnginePath {
    /// Returns the paths that this processor can run, with the fastest path last.
    #[must_use]
    pub fn available() -> Vec<Self> {
        #[allow(unused_mut, reason = "there is nothing to add on other processors")]
        let mut paths = vec![Self::Portable];
        #[cfg(target_arch = "x86_64")]
        {
            paths.extend(x86::Avx2::detect().map(Self::Avx2));
            paths.extend(x86::Avx512::detect().map(Self::Avx512));
        }
        paths
    }

    /// Returns the fastest path that this processor can run.
    #[must_use]
    pub fn best() -> Self {
        Self::available().pop().unwrap_or(Self::Portable)
    }

    /// Returns the path with this name.
    ///
    /// # Errors
    /// [`PathError`] if the name is unknown or this processor cannot run the path.
    pub fn named(name: &str) -> Result<Self, PathError> {
        Self::available()
            .into_iter()
            .find(|path| path.name() == name)
            .ok_or_else(|| PathError(name.to_owned()))
    }

    /// Returns the path named by [`PATH_VARIABLE`]; if the variable is not set, the fastest path.
    ///
    /// # Errors
    /// [`PathError`] if the variable names a path that is unknown or that this processor cannot
    /// run.
    pub fn from_environment() -> Result<Self, PathError> {
        match std::env::var(PATH_VARIABLE) {
            Ok(name) if !name.is_empty() => Self::named(&name),
            _ => Ok(Self::best()),
        }
    }

    /// Returns `portable`, `avx2` or `avx512`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => "avx2",
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => "avx512",
        }
    }

    fn names() -> String {
        let names: Vec<&str> = Self::available().into_iter().map(Self::name).collect();
        names.join(", ")
    }
}
