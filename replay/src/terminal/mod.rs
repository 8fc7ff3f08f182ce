//! Replays in the terminal: one state at a time, controlled by keys.
//!
//! [`player`] holds the state controlled by the keys; [`screen`] draws it with the characters of
//! [`cells`] and the colours of [`paints`].

pub mod cells;
pub mod paints;
pub mod player;
pub mod screen;

use super::recording::Recording;
use super::scene::Colouring;
use crossterm::event::{self, Event};
use paints::Paints;
use player::Player;
use ratatui::DefaultTerminal;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Maximum wait for a key before checking `stop`.
const PATIENCE: Duration = Duration::from_millis(50);

/// Minimum wait: without it, slow drawing would prevent keys from being read.
const A_LOOK: Duration = Duration::from_millis(1);

/// Plays a recording until a key or `stop` ends it; uses ASCII if the terminal's locale does not
/// support UTF-8. Restores the terminal afterwards, even after a panic.
///
/// # Errors
/// [`io::Error`] if standard output is not a terminal, or the terminal cannot be used or is closed.
pub fn play(
    recording: &Recording,
    colouring: Colouring,
    paints: Paints,
    ascii: bool,
    stop: &AtomicBool,
) -> io::Result<()> {
    let mut player = Player::new(recording, colouring);
    let played = ratatui::try_init()
        .and_then(|mut terminal| watch(&mut terminal, &mut player, paints, ascii, stop));
    // The terminal is restored even if the setup failed halfway.
    let restored = ratatui::try_restore();
    played.and(restored)
}

fn watch(
    terminal: &mut DefaultTerminal,
    player: &mut Player<'_>,
    paints: Paints,
    ascii: bool,
    stop: &AtomicBool,
) -> io::Result<()> {
    let mut last = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        // Draws even without an event: a resize before the first event is detected here. Only
        // changed cells are written.
        terminal.draw(|frame| {
            screen::draw(frame, player, paints);
            if ascii {
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
