//! Replays in the terminal: one state at a time, with keys.
//!
//! [`player`] is what the keys move, [`screen`] draws it, of the characters of [`cells`] in the
//! paints of [`paints`].

pub mod cells;
pub mod paints;
pub mod player;
pub mod screen;

use super::recording::Recording;
use super::scene::Colouring;
use crate::output;
use crossterm::event::{self, Event};
use paints::Paints;
use player::Player;
use ratatui::DefaultTerminal;
use std::io::{self, IsTerminal};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Longest wait for a key before it is looked whether to end.
const PATIENCE: Duration = Duration::from_millis(50);

/// Shortest wait: without any, no key would ever be seen where drawing is slow.
const A_LOOK: Duration = Duration::from_millis(1);

/// A replay cannot be played.
#[derive(Debug, thiserror::Error)]
pub enum PlayError {
    /// Nobody would see it, or could press a key.
    #[error("standard output is not a terminal to play the replay in")]
    NotATerminal,
    /// It cannot be drawn on.
    #[error("this terminal (TERM={0}) cannot play the replay: it only prints lines")]
    NoCodes(String),
    /// The terminal does not answer.
    #[error("the terminal: {0}")]
    Terminal(#[from] io::Error),
}

/// Whether there is a terminal to play in.
///
/// # Errors
/// [`PlayError`] if there is none.
pub fn check() -> Result<(), PlayError> {
    if !io::stdout().is_terminal() {
        Err(PlayError::NotATerminal)
    } else if !output::terminal_has_codes() {
        let term = std::env::var_os("TERM").unwrap_or_default();
        Err(PlayError::NoCodes(term.to_string_lossy().into_owned()))
    } else {
        Ok(())
    }
}

/// Plays a recording until a key, or `stop`, ends it. The terminal is as before afterwards, after a
/// panic too.
///
/// # Errors
/// [`PlayError`] if there is no terminal, or it goes away.
pub fn play(
    recording: &Recording,
    colouring: Colouring,
    stop: &AtomicBool,
) -> Result<(), PlayError> {
    check()?;
    let mut player = Player::new(recording, colouring);
    let played = ratatui::try_init()
        .and_then(|mut terminal| watch(&mut terminal, &mut player, Paints::of_terminal(), stop));
    // Also if it began and could not go on.
    let restored = ratatui::try_restore();
    Ok(played.and(restored)?)
}

fn watch(
    terminal: &mut DefaultTerminal,
    player: &mut Player<'_>,
    paints: Paints,
    stop: &AtomicBool,
) -> io::Result<()> {
    let mut last = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        // Also when nothing has happened: a window that changed before its changes were listened to
        // is met with the next look. Only cells that differ are written.
        terminal.draw(|frame| {
            screen::draw(frame, player, paints);
            if output::stdout_is_ascii() {
                screen::to_ascii(frame.buffer_mut());
            }
        })?;
        let left = match player.pause() {
            Some(pause) => pause.saturating_sub(last.elapsed()).clamp(A_LOOK, PATIENCE),
            None => PATIENCE,
        };
        if event::poll(left)? {
            match event::read()? {
                Event::Key(key) if player.key(key) => return Ok(()),
                _ => {}
            }
        }
        match player.pause() {
            Some(pause) if last.elapsed() < pause => {}
            Some(_) => {
                player.go_on();
                last = Instant::now();
            }
            None => last = Instant::now(),
        }
    }
    Ok(())
}
