//! Replays: looking at a run, in the terminal, on a page, in pictures.
//!
//! [`recording`] is what there is to see, made of the files that a run leaves behind; [`scene`] is
//! one state of it to draw, in the colours of [`palette`]; everything else here draws scenes.
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
