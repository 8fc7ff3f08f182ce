#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

#[cfg(feature = "gallery")]
pub mod gallery;
#[cfg(feature = "page")]
pub mod page;
pub mod palette;
#[cfg(feature = "pictures")]
pub mod pictures;
pub mod recording;
pub mod scene;
#[cfg(feature = "terminal")]
pub mod terminal;
