//! Replays in the terminal: one state at a time, controlled by keys.
//!
//! [`player`] holds what the keys change; [`screen`] draws it with the characters of [`cells`] and
//! the colours of [`paints`].

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

/// Longest wait for a key before checking whether to end.
const PATIENCE: Duration = Duration::from_millis(50);

/// Shortest wait: without it, keys would never be read where drawing is slow.
const A_LOOK: Duration = Duration::from_millis(1);

/// Plays a recording until a key or `stop` ends it; in ASCII if the terminal's locale supports
/// nothing else. Restores the terminal afterwards, even after a panic.
///
/// # Errors
/// If there is no terminal, or it is closed.
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
    // Even if setting it up failed halfway.
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
        // Draws even if nothing has happened: a resize before the first event is noticed here. Only
        // cells that differ are written.
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
