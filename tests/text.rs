//! Text from users: every encoded text is decoded correctly by the programs that read it.

use minimal_surprise_evolution::text::{
    self, FILE_NAME_BYTES_MAX, TextError, decode, file_name, file_name_except, html, is_hidden,
    markdown, markdown_code_cell, path_of_text, shell_path, shell_word, text_of_path,
};
use percent_encoding::percent_decode_str;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd};
use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};
use std::process::Command;
use tests::full::all_cases;

/// Texts that have caused or could cause errors.
const HARD: [&str; 32] = [
    "",
    " ",
    ".",
    "..",
    "../../x",
    "/abs/x",
    "noise 5/10",
    "a\nb",
    "\n",
    "a\n\n",
    "#1",
    "a|b",
    "a`b``c",
    "`",
    "<b>",
    "\u{1b}[2J",
    "x\u{202e}gpj",
    "zero\u{200b}width",
    "- a",
    "1. a",
    "con",
    "NUL.txt",
    "lpt9",
    ".hidden",
    "-rf",
    "trailing.",
    "trailing ",
    "it's",
    "$(date) `date` $HOME !!",
    "\\",
    "%s%n",
    "ノイズ",
];

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases: if all_cases() { 50 * cases } else { cases },
        rng_seed: RngSeed::Fixed(2020),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

fn hard() -> impl Iterator<Item = String> {
    let own = HARD.into_iter().map(str::to_owned);
    own.chain(["x".repeat(300), "é".repeat(300)])
}

/// Generates text that consists mostly of characters with a special meaning in some format.
fn any_text() -> impl Strategy<Value = String> {
    let special = "[ -~\n\t\r\u{1b}\u{7f}\u{85}\u{200b}\u{202e}\u{2066}\u{feff}éß√▶]{0,12}";
    prop_oneof![special, "\\PC{0,12}", any::<String>(), "[a-b.-]{0,5}"]
}

/// Generates program arguments, which contain no zero bytes.
fn any_bytes() -> impl Strategy<Value = Vec<u8>> {
    let some = prop::collection::vec(1..=255_u8, 0..12);
    prop_oneof![
        some,
        any_text().prop_map(|text| text.replace('\0', "").into_bytes())
    ]
}

fn check_file_name(text: &str) -> Result<(), TestCaseError> {
    let name = file_name(text);
    prop_assert!(name.len() <= FILE_NAME_BYTES_MAX, "{name}");
    prop_assert!(
        name.bytes()
            .all(|b| b.is_ascii_alphanumeric() || b"-_.".contains(&b)),
        "{name}"
    );
    prop_assert!(!name.is_empty() && !name.starts_with(['.', '-']) && !name.ends_with('.'));
    let stem = name.split('.').next().unwrap_or_default().to_uppercase();
    let number = |device: &str| {
        stem.strip_prefix(device)
            .is_some_and(|n| n.parse::<u8>().is_ok())
    };
    prop_assert!(
        !["CON", "PRN", "AUX", "NUL"].contains(&stem.as_str()),
        "{name}"
    );
    prop_assert!(!number("COM") && !number("LPT"), "{name}");
    let plain = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-';
    if name != text {
        prop_assert_ne!(
            file_name(&name),
            name,
            "the name could also belong to a different text"
        );
    } else {
        prop_assert!(text.bytes().all(|b| plain(b) || b"_.".contains(&b)));
    }
    Ok(())
}

#[test]
fn a_file_name_is_short_portable_and_unique_to_its_text() {
    let mut names = BTreeMap::new();
    let twins = ["Noise", "noise", "NOISE", "noise ", "noise/", "noise\\"];
    for text in hard().chain(twins.map(str::to_owned)) {
        check_file_name(&text).unwrap();
        let other = names.insert(file_name(&text).to_lowercase(), text.clone());
        assert_eq!(
            other, None,
            "{text:?} has the same name as a different text"
        );
    }
    proptest!(config(300), |(text in any_text(), other in any_text())| {
        check_file_name(&text)?;
        let same = file_name(&text).eq_ignore_ascii_case(&file_name(&other));
        prop_assert_eq!(same, text == other);
        let name = file_name(&text);
        if name == text {
            prop_assert_ne!(file_name_except(&text, &name), name);
        }
    });
    assert_eq!(file_name("partly-predefined"), "partly-predefined");
    assert_eq!(file_name("c-free-15x15-seed-7"), "c-free-15x15-seed-7");
    assert!(file_name("noise 5/10").starts_with("noise-5-10-"));
}

#[test]
fn invisible_characters_are_made_visible() {
    assert_eq!(
        text::terminal("a\u{1b}[2Jb\n\u{202e}"),
        r"a\u{1b}[2Jb\n\u{202e}"
    );
    assert_eq!(text::terminal_lines("a\n\tb\r\n"), "a\n\tb\\r\n");
    let path = Path::new(OsStr::from_bytes(b"a\xff\x1b\xe2\x80\xae"));
    assert_eq!(text::terminal_path(path), r"a\xff\u{1b}\u{202e}");
    proptest!(config(300), |(text in any_text())| {
        prop_assert!(!text::terminal(&text).chars().any(is_hidden));
        prop_assert!(!html(&text).chars().any(is_hidden));
        prop_assert!(!markdown(&text).chars().any(is_hidden));
        if !text.chars().any(is_hidden) {
            prop_assert_eq!(text::terminal(&text), text);
        }
    });
    for c in ('\0'..=char::MAX).filter(|c| c.is_control() || "\u{61c}\u{200e}\u{200f}".contains(*c))
    {
        assert!(is_hidden(c), "{c:?}");
    }
    for c in ('\u{202a}'..='\u{202e}').chain('\u{2066}'..='\u{2069}') {
        assert!(is_hidden(c), "{c:?}");
    }
}

/// Returns the words as read by `sh`.
fn read_by_sh(words: &[String]) -> Vec<Vec<u8>> {
    let script = format!(
        "for word in {}; do printf '%s\\0' \"$word\"; done",
        words.join(" ")
    );
    let output = Command::new("sh").arg("-c").arg(script).output().unwrap();
    assert!(output.status.success(), "{words:?}");
    let ended = output.stdout.strip_suffix(b"\0").unwrap_or_default();
    ended.split(|&byte| byte == 0).map(<[u8]>::to_vec).collect()
}

#[test]
fn a_shell_reads_back_a_word_of_any_bytes() {
    let check = |words: &[Vec<u8>]| {
        let quoted: Vec<String> = words
            .iter()
            .map(|w| shell_word(OsStr::from_bytes(w)))
            .collect();
        assert_eq!(read_by_sh(&quoted), words, "{quoted:?}");
    };
    let own = hard().map(String::into_bytes);
    let own: Vec<_> = own
        .chain([
            b"\xff\xfe".to_vec(),
            b"a\xff'\n\n".to_vec(),
            b"-\xff-".to_vec(),
        ])
        .collect();
    check(&own);
    proptest!(config(20), |(words in prop::collection::vec(any_bytes(), 1..50))| {
        check(&words);
        for word in words {
            let word = shell_word(OsStr::from_bytes(&word));
            prop_assert!(!word.trim_end_matches(['\n', '\'']).chars().any(is_hidden), "{word:?}");
        }
    });
    assert_eq!(shell_word("runs/a-1.0"), "runs/a-1.0");
    assert_eq!(shell_word("low density"), "'low density'");
    assert_eq!(shell_path(Path::new("-x")), "./-x");
}

#[test]
fn a_browser_reads_a_link_back_as_the_path() {
    let check = |parts: &[Vec<u8>]| -> Result<(), TestCaseError> {
        let path: PathBuf = parts.iter().map(|part| OsStr::from_bytes(part)).collect();
        let link = text::url(&path);
        prop_assert!(
            link.is_ascii() && !link.contains(['"', ' ', '#', '?', '<', '(', ')']),
            "{link}"
        );
        let read: PathBuf = link
            .split('/')
            .map(|part| OsString::from_vec(percent_decode_str(part).collect()))
            .collect();
        prop_assert_eq!(read, path.clone());
        let stored = text_of_path(&path);
        let whole = std::path::absolute(&path).unwrap();
        prop_assert_eq!(std::path::absolute(path_of_text(&stored)).unwrap(), whole);
        Ok(())
    };
    let part = any_bytes().prop_map(|part| {
        let part: Vec<u8> = part.into_iter().filter(|&byte| byte != b'/').collect();
        if part.is_empty() || part == b"." || part == b".." {
            b"x".to_vec()
        } else {
            part
        }
    });
    proptest!(config(300), |(parts in prop::collection::vec(part, 1..4))| check(&parts)?);
    for text in ["a:b", "noise 5#10", "a?b", "%41", "file:", "\u{202e}"] {
        check(&[text.as_bytes().to_vec()]).unwrap();
    }
    assert_eq!(text::url(Path::new("a b/c.svg")), "a%20b/c.svg");
    let odd = PathBuf::from(OsString::from_vec(b"/a b/\xff".to_vec()));
    assert_eq!(text_of_path(&odd), "file:///a%20b/%FF");
    assert_eq!(text_of_path(Path::new("a b")), "a b");
}

#[test]
fn a_page_shows_text_unchanged() {
    let check = |text: &str| {
        let page = format!("<p title=\"{0}\" lang='{0}'>{0}</p>", html(text));
        let read = roxmltree::Document::parse(&page).unwrap();
        let root = read.root_element();
        let shown = text::terminal(text);
        assert_eq!(root.text().unwrap_or_default(), shown);
        assert_eq!(root.attribute("title"), Some(shown.as_str()));
        assert_eq!(root.attribute("lang"), Some(shown.as_str()));
    };
    hard().for_each(|text| check(&text));
    proptest!(config(300), |(text in any_text())| {
        // XML does not allow these characters.
        prop_assume!(!text.contains(['\u{fffe}', '\u{ffff}']));
        check(&text);
    });
}

/// Returns the text of a Markdown document's only table row, heading or list item, and whether the
/// document has any other contents.
fn cells(document: &str) -> (Vec<String>, bool) {
    let (mut cells, mut inside, mut other) = (Vec::new(), false, false);
    for event in Parser::new_ext(
        document,
        Options::ENABLE_TABLES | Options::ENABLE_STRIKETHROUGH,
    ) {
        match event {
            Event::Start(Tag::TableCell | Tag::Item) => {
                inside = true;
                cells.push(String::new());
            }
            Event::End(TagEnd::TableCell | TagEnd::Item) => inside = false,
            Event::Text(text) | Event::Code(text) if inside => {
                cells.last_mut().unwrap().push_str(&text)
            }
            Event::Start(Tag::Table(_) | Tag::TableHead | Tag::TableRow | Tag::List(_))
            | Event::End(_) => {}
            _ => other = true,
        }
    }
    (cells, other)
}

#[test]
fn markdown_shows_text_unchanged_in_tables_and_lists() {
    let check = |text: &str| {
        let shown = text::terminal(text);
        let (text_cell, code_cell) = (markdown(text), markdown_code_cell(text));
        let table = format!("| a | b | c |\n|---|---|---|\n| {text_cell} | {code_cell} | end |\n");
        let (read, other) = cells(&table);
        assert!(!other, "{table}");
        let blank = shown.bytes().all(|b| b == b' ');
        assert_eq!(read[3], shown.trim_matches(' '), "{table}");
        assert!(read[4] == shown || blank, "{table}");
        assert_eq!(read[5], "end", "{table}");
        let list = format!("- {text_cell}\n- end\n");
        let (read, other) = cells(&list);
        assert!(!other, "{list}");
        assert_eq!(read, [shown.trim_matches(' '), "end"], "{list}");
    };
    hard().for_each(|text| check(&text));
    proptest!(config(300), |(text in any_text())| check(&text));
}

#[test]
fn a_text_file_is_read_in_the_forms_that_programs_save() {
    assert_eq!(decode(b"\xef\xbb\xbfa\r\nb\n"), Ok("a\nb\n".to_owned()));
    let utf16 = |text: &str, order: fn(u16) -> [u8; 2]| -> Vec<u8> {
        text.encode_utf16().flat_map(order).collect()
    };
    for text in ["\u{feff}Gen: 1", "Gen: 1", "\u{feff}é"] {
        assert_eq!(
            decode(&utf16(text, u16::to_le_bytes)),
            Err(TextError::Utf16),
            "{text:?}"
        );
        assert_eq!(
            decode(&utf16(text, u16::to_be_bytes)),
            Err(TextError::Utf16),
            "{text:?}"
        );
    }
    for (bytes, line, byte) in [(&b"a\nb\xff"[..], 2, 4), (b"\xef\xbb\xbf\xe9", 1, 4)] {
        assert_eq!(decode(bytes), Err(TextError::NotUtf8 { line, byte }));
    }
    proptest!(config(300), |(text in any_text())| {
        // Text that begins with zero bytes would be read as UTF-16.
        prop_assume!(!text.contains('\0'));
        let text = text.replace(['\r', '\u{feff}'], "");
        let windows = format!("\u{feff}{}", text.replace('\n', "\r\n"));
        prop_assert_eq!(decode(windows.as_bytes()), Ok(text.clone()));
        prop_assert_eq!(decode(text.as_bytes()), Ok(text));
    });
}
