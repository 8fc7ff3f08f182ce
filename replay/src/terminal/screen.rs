//! Screen layout: the run, the swarm with details beside it, the time, the keys.

use super::cells::{self, COLUMNS};
use super::paints::{Paints, soft};
use super::player::Player;
use crate::recording::Recording;
use crate::scene::{Colouring, Ink, Mark, Robot, Scene};
use minimal_surprise_evolution::settings::describe;
use minimal_surprise_evolution::text::ascii;
use minimal_surprise_sim::Heading;
use minimal_surprise_sim::damage::Damage;
use minimal_surprise_sim::structures::in_words;
use ratatui::Frame;
use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Style, Stylize};
use ratatui::text::{Line, Span};
use ratatui::widgets::{LineGauge, Sparkline, SparklineBar};
use std::path::Path;

/// Minimum number of columns for the details beside the swarm.
const PANEL: u16 = 34;

/// Maximum number of columns for the details.
const WIDE_PANEL: u16 = 64;

/// Maximum number of rows of details.
const PANEL_ROWS: u16 = 24;

/// Number of columns between the swarm and the details.
const GAP: u16 = 3;

/// The value of a full bar.
const FULL: f64 = 1000.0;

/// Keys available in every replay.
const KEYS: [(&str, &str); 8] = [
    ("q", "quit"),
    ("space", "play"),
    ("← →", "step"),
    ("↑ ↓", "ten"),
    ("0–9", "seek"),
    ("+ -", "speed"),
    ("n p", "robot"),
    ("c", "colour"),
];

/// Draws everything.
pub fn draw(frame: &mut Frame<'_>, player: &mut Player<'_>, paints: Paints) {
    let scene = player.scene();
    // In a low window, the swarm takes precedence, then the time.
    let low = frame.area().height < 8;
    let [title, middle, crop, time, keys] =
        block(frame.area(), &scene).layout(&Layout::vertical([
            Constraint::Length(if low { 0 } else { 2 }),
            Constraint::Fill(1),
            Constraint::Length(1),
            Constraint::Length(1),
            Constraint::Length(if low { 0 } else { 1 }),
        ]));
    draw_title(frame, title, player, paints);
    let (swarm, panel, crop_line) = sides(&scene, middle, crop);
    let [x, y] = player.view(swarm.width / COLUMNS, swarm.height);
    if let Some(line) = crop_line {
        let part = format!(
            " cropped: x {}–{} of {}, y {}–{} of {}",
            x.start,
            x.end.max(1) - 1,
            scene.width,
            y.start,
            y.end.max(1) - 1,
            scene.height
        );
        let scroll = Span::styled("   h j k l scroll", soft());
        let part = Span::styled(part, paints.warning());
        frame.render_widget(Line::from_iter([part, scroll]), line);
    }
    for (row, line) in swarm
        .rows()
        .zip(cells::lines(&scene, x.clone(), y.clone(), paints))
    {
        frame.render_widget(line, row);
    }
    if let Some(panel) = panel {
        draw_panel(frame, panel, player, &scene, paints);
    }
    draw_time(frame, time, player);
    draw_keys(frame, keys);
}

/// Replaces characters that a terminal without UTF-8 cannot show, cell by cell.
pub fn to_ascii(buffer: &mut Buffer) {
    for cell in &mut buffer.content {
        if !cell.symbol().is_ascii() {
            let like = ascii(cell.symbol());
            cell.set_symbol(if like.len() == 1 { &like } else { "?" });
        }
    }
}

/// Returns the used part of the window, limited so that the parts of the screen stay close
/// together.
fn block(window: Rect, scene: &Scene) -> Rect {
    let columns = COLUMNS.saturating_mul(scene.width);
    Rect {
        width: window.width.min(columns.saturating_add(GAP + WIDE_PANEL)),
        height: window
            .height
            .min(scene.height.max(PANEL_ROWS).saturating_add(4)),
        ..window
    }
}

/// Returns the areas of the swarm, the details and the note on cropping. The details are left out
/// if the whole swarm fits only without them.
fn sides(scene: &Scene, middle: Rect, crop: Rect) -> (Rect, Option<Rect>, Option<Rect>) {
    let columns = COLUMNS.saturating_mul(scene.width);
    let rows = scene.height;
    // The line of the note can be used as the swarm's last line.
    let whole = Rect {
        height: middle.height + crop.height,
        ..middle
    };
    let beside = |columns: u16| columns.saturating_add(GAP + PANEL) <= middle.width;
    let panel = beside(columns) || (columns > middle.width && beside(PANEL));
    let for_swarm = if panel {
        columns.min(middle.width - GAP - PANEL)
    } else {
        columns.min(middle.width)
    };
    let fits = for_swarm == columns && rows <= whole.height;
    let area = if fits { whole } else { middle };
    let swarm = Rect {
        width: for_swarm,
        height: rows.min(area.height),
        ..area
    };
    let panel = panel.then(|| {
        let x = swarm.right() + GAP;
        Rect {
            x,
            width: (area.right() - x).min(WIDE_PANEL),
            ..area
        }
    });
    (swarm, panel, (!fits).then_some(crop))
}

fn draw_title(frame: &mut Frame<'_>, area: Rect, player: &Player<'_>, paints: Paints) {
    let recording = player.recording;
    let origin = &recording.origin;
    let name = Path::new(&origin.name).file_name();
    let name = name.map_or(origin.name.clone(), |name| name.display().to_string());
    let mut first = vec![name.bold(), recording.grid.to_string().into()];
    first.push(format!("{} robots", recording.robots()).into());
    first.push(match &recording.controller {
        Some(controller) => describe(controller.topology).into(),
        None => "poses only".into(),
    });
    if origin.noise > 0.0 {
        first.push(format!("noise {}", origin.noise).into());
    }
    let mut second = vec![in_words(&recording.names).bold()];
    if let Some(controller) = &recording.controller {
        second.push(match so_far(&controller.fitness, player.t) {
            Some(fitness) => format!("fitness so far {fitness:.4}").into(),
            None => "fitness so far –".into(),
        });
    }
    if let Some(seed) = origin.seed {
        second.push(format!("seed {seed}").into());
    }
    if let Some(hash) = &origin.run_hash {
        second.push(format!("hash {}", short(hash)).into());
    }
    if let Some(hash) = &recording.steps_hash {
        let hash = hash.to_string();
        second.push(match &origin.steps_hash {
            Some(recorded) if recorded.hash != hash => {
                Span::styled("not identical to the recorded run", paints.warning())
            }
            _ => format!("steps {}", short(&hash)).into(),
        });
    }
    for (row, parts) in area.rows().zip([first, second]) {
        frame.render_widget(spaced(parts, "  "), row);
    }
}

/// Returns the first digits of a hash.
fn short(hash: &str) -> &str {
    hash.get(..8).unwrap_or(hash)
}

fn spaced(parts: Vec<Span<'static>>, space: &'static str) -> Line<'static> {
    let parts = parts.into_iter().flat_map(|part| [space.into(), part]);
    let mut line = Line::from_iter(parts);
    line.spans[0] = " ".into();
    line
}

/// Returns the value after the step that led to state `t`.
fn so_far(values: &[f64], t: usize) -> Option<f64> {
    values.get(t.checked_sub(1)?).copied()
}

fn draw_panel(
    frame: &mut Frame<'_>,
    area: Rect,
    player: &Player<'_>,
    scene: &Scene,
    paints: Paints,
) {
    let words = [
        damage(player, paints),
        picked(player, scene, paints),
        legend(player, paints),
    ];
    let words: Vec<Line<'_>> = words.into_iter().flatten().collect();
    let charts = charts(player.recording, player.t, paints);
    let room = area.height.saturating_sub(words.len() as u16);
    let high = (room / charts.len() as u16).clamp(2, 4);
    let mut rows = area;
    for chart in charts {
        let [label, bars, rest] = rows.layout(&Layout::vertical([
            Constraint::Length(1),
            Constraint::Length((high - 1).min(2)),
            Constraint::Fill(1),
        ]));
        frame.render_widget(chart.bars(bars.width, player), bars);
        let words = [chart.label.into(), "  ".into(), chart.now.bold()];
        frame.render_widget(Line::from_iter(words), label);
        rows = rest;
        if high == 4 {
            rows.y += 1;
            rows.height = rows.height.saturating_sub(1);
        }
    }
    for (row, line) in rows.rows().zip(words) {
        frame.render_widget(line, row);
    }
}

/// A chart of a value over time.
struct Chart {
    label: String,
    now: String,
    /// One value per state, 0 to 1.
    values: Vec<f64>,
    style: Style,
}

fn charts(recording: &Recording, t: usize, paints: Paints) -> Vec<Chart> {
    let states = 0..=recording.steps();
    let of_steps = |label: &str, values: &[f64], digits: usize, style| Chart {
        style,
        label: label.to_owned(),
        now: so_far(values, t).map_or("–".to_owned(), |now| format!("{now:.digits$}")),
        values: states
            .clone()
            .map(|t| so_far(values, t).unwrap_or(0.0))
            .collect(),
    };
    let mut charts = Vec::new();
    if let Some(controller) = &recording.controller {
        charts.push(of_steps(
            "fitness so far",
            &controller.fitness,
            4,
            paints.hit(),
        ));
    }
    charts.push(of_steps(
        "temperature",
        &recording.temperature,
        2,
        paints.other(),
    ));
    if let Some(name) = recording.name() {
        let robots = recording.robots();
        let share = |t| recording.in_structure(t) as f64 / robots.max(1) as f64;
        charts.push(Chart {
            label: format!("in {}", name.name()),
            now: format!("{} of {robots}", recording.in_structure(t)),
            values: states.map(share).collect(),
            style: paints.named(),
        });
    }
    charts
}

impl Chart {
    /// Draws the bars: each column shows the mean of its states, or several columns show one state;
    /// future states are faint.
    fn bars(&self, columns: u16, player: &Player<'_>) -> Sparkline<'static> {
        let states = self.values.len();
        let columns = usize::from(columns);
        let bars = (0..columns).map(|column| {
            let from = column * states / columns;
            let to = ((column + 1) * states / columns).max(from + 1);
            let mean = self.values[from..to].iter().sum::<f64>() / (to - from) as f64;
            let style = if from <= player.t {
                self.style
            } else {
                self.style.patch(soft())
            };
            SparklineBar::from((mean * FULL).round() as u64).style(style)
        });
        Sparkline::default().data(bars).max(FULL as u64)
    }
}

fn damage(player: &Player<'_>, paints: Paints) -> Vec<Line<'static>> {
    let Some(damaged) = &player.recording.origin.damage else {
        return Vec::new();
    };
    let done = match damaged.damage {
        Damage::Remove(_) => "removed",
        Damage::Reposition(_) => "repositioned",
    };
    let area = Span::styled(cells::AREA.to_string().repeat(2), paints.area());
    let toggle = if player.before {
        "before damage    b shows the run"
    } else {
        "b shows the swarm before"
    };
    vec![
        Line::from_iter([area, format!(" {done} at the start").into()]),
        Line::styled(toggle, soft()),
        Line::default(),
    ]
}

/// Describes the selected robot and explains its marks.
fn picked(player: &Player<'_>, scene: &Scene, paints: Paints) -> Vec<Line<'static>> {
    let Some((robot, at)) = scene.picked.and_then(|robot| {
        let at = scene.robots.get(robot)?;
        Some((robot, at))
    }) else {
        return Vec::new();
    };
    let facing = ["east", "north", "west", "south"][usize::from(at.heading) % 4];
    let count = |wanted: [Mark; 2]| {
        let marks = scene.marks.iter();
        marks.filter(|cell| wanted.contains(&cell.mark)).count()
    };
    let key = |words: &str, marks: [Mark; 2]| {
        let of = |mark| Span::styled(cells::mark(mark).to_string(), paints.mark(mark));
        Line::from_iter([
            format!("{words:<16}").into(),
            of(marks[0]),
            " robot  ".into(),
            of(marks[1]),
            " none".into(),
        ])
    };
    let mut lines = vec![Line::from_iter([
        format!("robot {robot}").bold(),
        format!(" at {},{} facing {facing}", at.x, at.y).into(),
    ])];
    if player.recording.controller.is_none() {
        lines.push("predictions are unknown".into());
    } else if player.t == player.recording.steps() {
        lines.push(key("expects", [Mark::ExpectsOccupied, Mark::ExpectsEmpty]));
    } else {
        let (hits, misses) = (
            [Mark::HitOccupied, Mark::HitEmpty],
            [Mark::MissOccupied, Mark::MissEmpty],
        );
        lines.push(key(&format!("as predicted {:>2}", count(hits)), hits));
        lines.push(key(&format!("mispredicted {:>2}", count(misses)), misses));
    }
    lines.push(Line::styled(
        match player.recording.controller {
            Some(_) => "left of each cell    Esc deselects",
            None => "Esc deselects",
        },
        soft(),
    ));
    lines.push(Line::default());
    lines
}

/// Explains the arrows.
fn legend(player: &Player<'_>, paints: Paints) -> Vec<Line<'static>> {
    let arrow = |ink| {
        let (x, y, heading) = (0, 0, Heading::East as u8);
        let drawn = cells::robot(Robot { x, y, heading, ink });
        Span::styled(format!("{drawn} "), paints.ink(ink))
    };
    let entry = |ink, words: String| Line::from_iter([arrow(ink), words.into()]);
    let recording = player.recording;
    match player.colouring {
        _ if player.before => Vec::new(),
        Colouring::Plain => Vec::new(),
        Colouring::Structure => {
            let mut lines = Vec::new();
            if let Some(name) = recording.name() {
                lines.push(entry(Ink::Named, name.name().to_owned()));
            }
            lines.push(entry(Ink::Other, "another structure".to_owned()));
            lines.push(entry(Ink::Outside, "none".to_owned()));
            lines
        }
        Colouring::Surprise if player.t == recording.steps() => {
            vec!["the run ends before they sense".into()]
        }
        Colouring::Surprise => {
            let most = Span::styled(
                cells::MOST_SURPRISED.to_string(),
                paints.ink(Ink::Surprise(3)),
            );
            vec![
                entry(Ink::Surprise(0), "no sensor mispredicted".to_owned()),
                entry(Ink::Surprise(1), "up to 1/8".to_owned()),
                entry(Ink::Surprise(2), "up to 1/4".to_owned()),
                Line::from_iter([most, arrow(Ink::Surprise(3)), "more".into()]),
            ]
        }
    }
}

fn draw_time(frame: &mut Frame<'_>, area: Rect, player: &Player<'_>) {
    let steps = player.recording.steps();
    let digits = steps.to_string().len();
    let state = match (player.before, player.playing) {
        (true, _) => "before",
        (false, true) => "playing",
        (false, false) => "paused",
    };
    let label = format!(
        " {state:<7} {:>3}/s  step {:>digits$} of {steps} ",
        player.speed(),
        player.t
    );
    let gauge = LineGauge::default()
        .label(label.bold())
        .ratio(player.t as f64 / steps.max(1) as f64)
        .filled_symbol("━")
        .unfilled_symbol("─")
        .filled_style(Style::new().bold())
        .unfilled_style(soft());
    frame.render_widget(gauge, area);
}

fn draw_keys(frame: &mut Frame<'_>, area: Rect) {
    let spans = KEYS.into_iter().flat_map(|(key, does)| {
        let does = format!(" {does} ");
        [Span::from(" "), key.bold(), Span::styled(does, soft())]
    });
    frame.render_widget(Line::from_iter(spans), area);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Origin;
    use crossterm::event::{KeyCode, KeyEvent};
    use minimal_surprise_controller::{Genome, Topology};
    use minimal_surprise_sim::exchange::Trajectory;
    use minimal_surprise_sim::{Grid, NoiseRate, Scenario, SeedTree};
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    /// Returns a recording with a pair facing east and west, a robot driving north, and one that
    /// turns.
    fn recording() -> Recording {
        let states = [
            "2, 3, 1, 0|3, 3, -1, 0|0, 0, 0, 1|5, 1, 0, -1",
            "2, 3, 1, 0|3, 3, -1, 0|0, 1, 0, 1|5, 1, 1, 0",
            "2, 3, 1, 0|3, 3, -1, 0|0, 2, 0, 1|5, 1, 0, -1",
        ];
        let mut text = "Gen: 0\nGrid: 7, 5\nAgents: 4\n".to_owned();
        for (t, robots) in states.into_iter().enumerate() {
            for robot in robots.split('|') {
                text.push_str(&format!("{t}: {robot}\n"));
            }
        }
        let trajectory = Trajectory::read(&text).unwrap();
        Recording::of_trajectory("folder/agent_trajectory", &trajectory).unwrap()
    }

    fn screen(player: &mut Player<'_>, columns: u16, rows: u16) -> Vec<String> {
        let mut terminal = Terminal::new(TestBackend::new(columns, rows)).unwrap();
        let drawn = terminal.draw(|frame| draw(frame, player, Paints::None));
        let cells = drawn.unwrap().buffer.content.chunks(columns.into());
        let rows = cells.map(|row| row.iter().map(|cell| cell.symbol()).collect::<String>());
        rows.map(|row| row.trim_end().to_owned()).collect()
    }

    fn press(player: &mut Player<'_>, key: KeyCode) {
        assert!(!player.key(KeyEvent::from(key)));
    }

    #[test]
    fn a_wide_window_shows_swarm_and_details_side_by_side() {
        let recording = recording();
        let mut player = Player::new(&recording, Colouring::Structure);
        press(&mut player, KeyCode::Right);
        press(&mut player, KeyCode::Char('n'));
        let expected = [
            " agent_trajectory  7x5  4 robots  poses only",
            " pair and random dispersion (tied)",
            " · · · · · · ·   temperature  0.25",
            " · · ▶ ◀ · · ·",
            " · · · · · · ·                        ▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄",
            " ▴ · · · · ▸ ·   in pair  2 of 4",
            " · · · · · · ·",
            "                 ███████████████████████████████████████████████████████████████",
            "                 robot 0 at 2,3 facing east",
            "                 predictions are unknown",
            "                 Esc deselects",
            "",
            "                 ▶ pair",
            "                 ▸ another structure",
            "                 ▷ none",
            "",
            " paused   10/s  step 1 of 2  ━━━━━━━━━━━━━━━━━━━━━━━━━──────────────────────────",
            " q quit  space play  ← → step  ↑ ↓ ten  0–9 seek  + - speed  n p robot  c colour",
        ];
        assert_eq!(screen(&mut player, 80, 18), expected);
    }

    #[test]
    fn a_window_of_60_columns_shows_how_to_quit() {
        let recording = recording();
        let mut player = Player::new(&recording, Colouring::Plain);
        let keys = screen(&mut player, 60, 18).pop();
        assert!(keys.is_some_and(|keys| keys.contains("q quit  space play")));
    }

    #[test]
    fn a_low_and_narrow_window_shows_the_swarm_the_time_and_that_it_is_cropped() {
        let recording = recording();
        let mut player = Player::new(&recording, Colouring::Plain);
        let expected = [
            " · · · · · · ·",
            " · · ▶ ◀ · · ·",
            " · · · · · · ·",
            " cropped: x 0–6 of 7, y 2–4 of 5   h j",
            " paused   10/s  step 0 of 2  ─────────",
        ];
        assert_eq!(screen(&mut player, 38, 5), expected);
    }

    #[test]
    fn no_window_is_too_small() {
        let recording = recording();
        for (columns, rows) in (1..50).flat_map(|columns| (1..26).map(move |rows| (columns, rows)))
        {
            let mut player = Player::new(&recording, Colouring::Structure);
            press(&mut player, KeyCode::Char('p'));
            let _ = screen(&mut player, columns, rows);
        }
    }

    #[test]
    fn a_view_scrolls_to_the_edges_and_no_farther() {
        let recording = recording();
        let mut player = Player::new(&recording, Colouring::Plain);
        assert_eq!(player.view(3, 2), [0..3, 3..5]);
        press(&mut player, KeyCode::Char('l'));
        press(&mut player, KeyCode::Char('j'));
        assert_eq!(player.view(3, 2), [4..7, 0..2]);
        press(&mut player, KeyCode::Char('h'));
        press(&mut player, KeyCode::Char('k'));
        assert_eq!(player.view(3, 2), [0..3, 3..5]);
        assert_eq!(player.view(100, 100), [0..7, 0..5]);
    }

    #[test]
    fn a_picked_robot_is_in_view_until_the_view_is_scrolled() {
        let recording = recording();
        let mut player = Player::new(&recording, Colouring::Plain);
        for robot in 0..recording.robots() {
            press(&mut player, KeyCode::Char('n'));
            assert_eq!(player.picked, Some(robot));
            for (t, key) in [(0, KeyCode::Home), (1, KeyCode::Right), (2, KeyCode::End)] {
                press(&mut player, key);
                let pose = recording.poses(t)[robot];
                let [x, y] = player.view(2, 1);
                assert!(x.contains(&pose.x) && y.contains(&pose.y), "{robot}, {t}");
            }
        }
        press(&mut player, KeyCode::Char('h'));
        assert_eq!(player.view(2, 1)[0], 0..2);
    }

    #[test]
    fn every_ink_and_mark_is_drawn() {
        let topology = Topology::default();
        let genome = Genome::random(topology, &mut ChaCha8Rng::seed_from_u64(1));
        let grid = Grid::new(9, 9).unwrap();
        let scenario = Scenario::new(grid, 30, 20, NoiseRate::NONE).unwrap();
        let trial = scenario.trial(SeedTree::new(1), 0, 0);
        let recording =
            Recording::of_trial(&genome, &scenario, &trial, Origin::default(), &|| ()).unwrap();
        let mut player = Player::new(&recording, Colouring::Surprise);
        press(&mut player, KeyCode::Char('n'));
        let mut seen = String::new();
        for _ in 0..=recording.steps() {
            seen.push_str(&screen(&mut player, 80, 24).join("\n"));
            press(&mut player, KeyCode::Right);
        }
        for drawn in "▷▸▶!■□✘×●○".chars() {
            assert!(seen.contains(drawn), "no {drawn}");
        }
    }
}
