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
use crossterm::event::{self, Event};
use paints::Paints;
use player::Player;
use ratatui::DefaultTerminal;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Longest wait for a key before it is looked whether to end.
const PATIENCE: Duration = Duration::from_millis(50);

/// Shortest wait: without any, no key would ever be seen where drawing is slow.
const A_LOOK: Duration = Duration::from_millis(1);

/// Plays a recording until a key, or `stop`, ends it; in ASCII where the terminal's locale knows
/// nothing else. Afterwards the terminal is restored, after a panic too.
///
/// # Errors
/// If there is no terminal, or it goes away.
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
    // Also if it began and could not go on.
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
        // Also when nothing has happened: a window that changed before its changes were listened to
        // is met with the next look. Only cells that differ are written.
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
