//! One file a command: check what was given, do it, show it.

pub mod bench;
pub mod classify;
pub mod damage;
pub mod evaluate;
pub mod evolve;
pub mod export;
pub mod import;
pub mod inspect;
pub mod suite;

/// Input that cannot be used, in one message.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct BadInput(String);

impl BadInput {
    /// With whatever message says what is wrong.
    pub fn new(message: impl ToString) -> Self {
        Self(message.to_string())
    }
}

/// The threads to work on; one a core if no number is given.
///
/// # Errors
/// If the operating system gives no threads.
pub fn thread_pool(threads: Option<u32>) -> Result<rayon::ThreadPool, rayon::ThreadPoolBuildError> {
    let threads = threads.unwrap_or(0) as usize;
    rayon::ThreadPoolBuilder::new().num_threads(threads).build()
}
