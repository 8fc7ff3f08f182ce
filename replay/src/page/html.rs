//! The common frame of all pages: one self-contained document.

use crate::palette::{DARK, LIGHT, Theme};
use minimal_surprise_controller::Turn;
use minimal_surprise_evolution::text;
use serde_json::Value;
use std::fmt::Write;

/// Turns, by their number on the page.
pub(super) const TURNS: [Turn; 2] = [Turn::CounterClockwise, Turn::Clockwise];
const _: () = assert!(TURNS[0] as u8 == 0 && TURNS[1] as u8 == 1);

/// The parts of a page.
#[derive(Clone, Copy, Debug)]
pub struct Document<'a> {
    /// The window's title.
    pub title: &'a str,
    /// The page's own style, after the common one.
    pub style: &'a str,
    /// The body.
    pub body: &'a str,
    /// The page's own script, after the common one.
    pub script: &'a str,
    /// JSON data for the script.
    pub about: &'a Value,
    /// Packed data for the script.
    pub data: &'a str,
}

impl Document<'_> {
    /// Returns the text of the file. The page's security policy prevents the browser from loading
    /// anything.
    #[must_use]
    pub fn to_html(&self) -> String {
        let Self {
            title,
            style,
            body,
            script,
            about,
            data,
        } = self;
        let (light, dark) = (variables(&LIGHT), variables(&DARK));
        // Escaped so that the JSON cannot close its tag.
        let about = about.to_string().replace('<', "\\u003c");
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; \
             style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <link rel=\"icon\" href=\"data:,\">\n<title>{title}</title>\n<style>\n\
             :root {{ color-scheme: light; {light} }}\n\
             @media (prefers-color-scheme: dark) {{ :root {{ color-scheme: dark; {dark} }} }}\n\
             :root[data-theme=light] {{ color-scheme: light; {light} }}\n\
             :root[data-theme=dark] {{ color-scheme: dark; {dark} }}\n\
             {common_style}{style}</style>\n</head>\n<body>\n{body}\
             <script type=\"application/json\" id=\"about\">{about}</script>\n\
             <script type=\"text/plain\" id=\"data\">{data}</script>\n\
             <script>\n'use strict';\n{common_script}{script}</script>\n</body>\n</html>\n",
            title = text::html(title),
            common_style = include_str!("common.css"),
            common_script = include_str!("common.js"),
        )
    }
}

/// Formats the colours of a theme as CSS variables.
fn variables(theme: &Theme) -> String {
    let mut text = String::new();
    if let Ok(Value::Object(colours)) = serde_json::to_value(theme) {
        for (name, colour) in &colours {
            let levels = colour.as_array();
            if let Some(colour) = colour.as_str() {
                let _ = write!(text, "--{name}: {colour}; ");
            }
            for (level, colour) in levels.into_iter().flatten().enumerate() {
                let _ = write!(
                    text,
                    "--{name}-{level}: {}; ",
                    colour.as_str().unwrap_or_default()
                );
            }
        }
    }
    text
}
