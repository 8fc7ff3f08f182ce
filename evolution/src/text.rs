//! Text escaping and decoding. Escaping makes user text safe in file names, pages, links, shells,
//! compilers and terminals; decoding turns the bytes of a text file into text.

use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, percent_decode_str, percent_encode};
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::fmt::Write;
use std::path::{Component, Path, PathBuf};

/// Maximum length of a [`file_name`], in bytes: file systems allow 255; the rest is left for
/// extensions and temporary names.
pub const FILE_NAME_BYTES_MAX: usize = 100;

/// Number of hexadecimal digits of the hash in a [`file_name`].
const HASH_DIGITS: usize = 12;

/// Device names on Windows, reserved with any extension.
const DEVICES: [&str; 6] = ["con", "prn", "aux", "nul", "com", "lpt"];

/// Returns a file name for any text. Different texts get different names, even on file systems that
/// ignore case. A text of `a` to `z`, `0` to `9`, `-`, `_` and `.` is used unchanged; any other
/// text keeps its letters and digits, followed by a hash of the whole text.
#[must_use]
pub fn file_name(text: &str) -> String {
    if is_file_name(text) {
        text.to_owned()
    } else {
        hashed_file_name(text)
    }
}

/// Like [`file_name`], but returns a name different from `taken`.
#[must_use]
pub fn file_name_except(text: &str, taken: &str) -> String {
    match file_name(text) {
        name if name == taken => hashed_file_name(text),
        name => name,
    }
}

/// Like [`file_name`], but returns a name that is not in `taken`, and adds it to `taken`.
#[must_use]
pub fn new_file_name(text: &str, taken: &mut BTreeSet<String>) -> String {
    let mut name = file_name(text);
    for number in 2_u64.. {
        if taken.insert(name.clone()) {
            break;
        }
        name = file_name(&format!("{text}-{number}"));
    }
    name
}

fn hashed_file_name(text: &str) -> String {
    let mut name = String::new();
    for c in text.chars() {
        if c.is_ascii_alphanumeric() || "_.".contains(c) {
            name.push(c);
        } else if !name.ends_with('-') {
            name.push('-');
        }
    }
    name.truncate(FILE_NAME_BYTES_MAX - HASH_DIGITS - 2);
    let trimmed = name.trim_matches(['-', '.']);
    let front = if trimmed.is_empty() || is_device(trimmed) {
        "_"
    } else {
        ""
    };
    let hash = hex(&Sha256::digest(text.as_bytes()));
    format!("{front}{trimmed}-{}", &hash[..HASH_DIGITS])
}

/// Checks whether a text can be used unchanged as a file name. A text that ends like a hashed name
/// cannot, because it could be the name of a different text.
fn is_file_name(text: &str) -> bool {
    let plain = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b"-_.".contains(&b);
    let is_hash = |end: &str| {
        end.len() == HASH_DIGITS && end.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'))
    };
    !text.is_empty()
        && text.len() <= FILE_NAME_BYTES_MAX
        && text.bytes().all(plain)
        && !text.starts_with(['.', '-'])
        && !text.ends_with('.')
        && !is_device(text)
        && !text.rsplit_once('-').is_some_and(|(_, end)| is_hash(end))
}

fn is_device(name: &str) -> bool {
    let stem = name
        .split('.')
        .next()
        .unwrap_or_default()
        .to_ascii_lowercase();
    DEVICES.contains(&stem.trim_end_matches(|c: char| c.is_ascii_digit()))
}

/// Formats bytes as hexadecimal digits, two per byte.
#[must_use]
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Maximum number of letters and digits that [`identifier`] keeps: C distinguishes 63 characters.
const IDENTIFIER_MAX: usize = 24;

/// Reserved words of C and Rust.
const KEYWORDS: &str = "abstract alignas alignof as async auto await become bool box break case char \
    const constexpr continue crate default do double dyn else enum extern false final float fn for \
    gen goto if impl in inline int let long loop macro main match mod move mut nullptr override \
    priv pub ref register restrict return self short signed sizeof static static_assert struct \
    super switch thread_local trait true try type typedef typeof typeof_unqual union unsafe \
    unsigned unsized use virtual void volatile where while yield";

/// Returns part of a C and Rust identifier: the first ASCII letters and digits of a text.
#[must_use]
pub fn identifier(text: &str) -> String {
    let mut name = String::new();
    for c in text.chars() {
        if c.is_ascii_alphanumeric() {
            name.push(c.to_ascii_lowercase());
        } else if !name.is_empty() && !name.ends_with('_') {
            name.push('_');
        }
    }
    name.truncate(IDENTIFIER_MAX);
    name.trim_end_matches('_').to_owned()
}

/// Checks an identifier for C and Rust.
///
/// # Errors
/// A description of valid identifiers if `text` is not a valid one.
pub fn checked_identifier(text: &str) -> Result<&str, &'static str> {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let is_keyword = KEYWORDS.split_whitespace().any(|keyword| keyword == text);
    if text.starts_with(|c: char| c.is_ascii_alphabetic())
        && text.chars().all(plain)
        && text.len() <= 63
        && !is_keyword
    {
        Ok(text)
    } else {
        Err(
            "expected a C and Rust identifier: up to 63 letters, digits and _, starting with a letter, \
             and not a keyword",
        )
    }
}

/// Checks whether a character is neither visible nor an ordinary space: control characters, line
/// breaks, text direction marks or zero-width characters.
#[must_use]
pub fn is_hidden(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{115f}' | '\u{1160}' | '\u{17b4}' | '\u{17b5}'
            | '\u{180b}'..='\u{180f}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}' | '\u{2800}' | '\u{3164}' | '\u{fe00}'..='\u{fe0f}' | '\u{feff}'
            | '\u{ffa0}' | '\u{fff0}'..='\u{fffb}' | '\u{1bca0}'..='\u{1bca3}'
            | '\u{1d173}'..='\u{1d17a}' | '\u{e0000}'..='\u{e0fff}')
}

/// Escapes text for a terminal, on one line: [hidden](is_hidden) characters become escapes such as
/// `\n` and `\u{1b}`.
#[must_use]
pub fn terminal(text: &str) -> String {
    visible(text, "")
}

/// Escapes text for a terminal, on several lines: line breaks and tabs are kept.
#[must_use]
pub fn terminal_lines(text: &str) -> String {
    visible(text, "\n\t")
}

/// Escapes a path for a terminal; bytes that are not UTF-8 become escapes such as `\xff`.
#[must_use]
pub fn terminal_path(path: &Path) -> String {
    let mut shown = String::new();
    for chunk in path.as_os_str().as_encoded_bytes().utf8_chunks() {
        shown += &terminal(chunk.valid());
        for byte in chunk.invalid() {
            let _ = write!(shown, "\\x{byte:02x}");
        }
    }
    shown
}

fn visible(text: &str, but: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        if is_hidden(c) && !but.contains(c) {
            shown.extend(c.escape_default());
        } else {
            shown.push(c);
        }
    }
    shown
}

/// Escapes text for a terminal without UTF-8.
#[must_use]
pub fn ascii(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for letter in text.chars() {
        let like = match letter {
            letter if letter.is_ascii() => {
                shown.push(letter);
                continue;
            }
            '▶' | '▷' | '▸' => ">",
            '▲' | '△' | '▴' => "^",
            '◀' | '◁' | '◂' => "<",
            '▼' | '▽' | '▾' => "v",
            '·' => ".",
            '–' | '—' | '−' | '─' => "-",
            '━' => "=",
            '…' => "...",
            '×' => "x",
            '✘' => "X",
            '■' | '█' => "#",
            '□' => "+",
            '●' => "@",
            '○' => "o",
            '░' => ":",
            '←' => "<",
            '→' => ">",
            '↑' => "^",
            '↓' => "v",
            '▁' => "_",
            '▂' => ".",
            '▃' => "-",
            '▄' => "=",
            '▅' => "+",
            '▆' => "*",
            '▇' => "%",
            '⁰'..='⁹' | '²' | '³' | '¹' => "^",
            _ => {
                shown.extend(letter.escape_unicode());
                continue;
            }
        };
        shown.push_str(like);
    }
    shown
}

/// Escapes text for HTML, including inside quotes.
#[must_use]
pub fn html(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in terminal(text).chars() {
        match c {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            '\'' => escaped += "&#39;",
            c => escaped.push(c),
        }
    }
    escaped
}

/// Escapes text for use in a Markdown paragraph, list or table cell.
#[must_use]
pub fn markdown(text: &str) -> String {
    let shown = terminal(text);
    // Leading spaces can turn text into code, and are not visible anyway.
    let shown = shown.trim_matches(' ');
    let mut escaped = String::with_capacity(shown.len());
    for (place, c) in shown.char_indices() {
        let (before, after) = (&shown[..place], &shown[place + c.len_utf8()..]);
        let means_something = match c {
            '\\' | '`' | '*' | '_' | '[' | ']' | '|' | '~' | '$' => true,
            '<' => after.starts_with(|c: char| c.is_alphabetic() || "/!?".contains(c)),
            '&' => after.starts_with(|c: char| c.is_alphabetic() || c == '#'),
            '#' | '+' | '-' | '=' | '>' => before.is_empty(),
            '.' | ')' => {
                before.bytes().all(|b| b.is_ascii_digit())
                    && (after.is_empty() || after.starts_with(' '))
            }
            _ => false,
        };
        if means_something {
            escaped.push('\\');
        }
        escaped.push(c);
    }
    escaped
}

/// Formats text as code in Markdown.
#[must_use]
pub fn markdown_code(text: &str) -> String {
    let shown = terminal(text);
    let runs = shown.split(|c| c != '`').map(str::len);
    let fence = "`".repeat(1 + runs.max().unwrap_or(0));
    // Markdown drops one space at each end.
    let pad = if shown.is_empty() || shown.starts_with(['`', ' ']) || shown.ends_with(['`', ' ']) {
        " "
    } else {
        ""
    };
    format!("{fence}{pad}{shown}{pad}{fence}")
}

/// Formats text as code in a Markdown table cell, where a bar ends the cell even inside code.
#[must_use]
pub fn markdown_code_cell(text: &str) -> String {
    markdown_code(text).replace('|', r"\|")
}

/// Characters that are not escaped in a part of a URL.
const IN_URL: &AsciiSet = &NON_ALPHANUMERIC
    .remove(b'-')
    .remove(b'.')
    .remove(b'_')
    .remove(b'~');

/// Formats a path as a URL; a relative path gives a relative URL.
#[must_use]
pub fn url(path: &Path) -> String {
    let mut url = String::new();
    for component in path.components() {
        if !url.is_empty() && !url.ends_with('/') {
            url.push('/');
        }
        match component {
            Component::RootDir => url.push('/'),
            other => {
                let bytes = other.as_os_str().as_encoded_bytes();
                url.extend(percent_encode(bytes, IN_URL));
            }
        }
    }
    url
}

/// Prefix of a text that holds a path as a URL.
const FILE_URL: &str = "file://";

/// Converts a path to text that [`path_of_text`] can convert back: unchanged if it is UTF-8,
/// otherwise as a URL of the absolute path.
#[must_use]
pub fn text_of_path(path: &Path) -> String {
    match path.to_str() {
        Some(text) if !text.starts_with(FILE_URL) => text.to_owned(),
        _ => {
            let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
            format!("{FILE_URL}{}", url(&whole))
        }
    }
}

/// Returns the path that [`text_of_path`] converted to this text.
#[must_use]
pub fn path_of_text(text: &str) -> PathBuf {
    match text.strip_prefix(FILE_URL) {
        None => PathBuf::from(text),
        Some(url) => PathBuf::from(os_string(percent_decode_str(url).collect())),
    }
}

#[cfg(unix)]
fn os_string(bytes: Vec<u8>) -> OsString {
    std::os::unix::ffi::OsStringExt::from_vec(bytes)
}

#[cfg(not(unix))]
fn os_string(bytes: Vec<u8>) -> OsString {
    String::from_utf8_lossy(&bytes).into_owned().into()
}

/// Quotes an argument for a POSIX shell. The result is printable and on one line, unless the
/// argument ends with a line break.
#[must_use]
pub fn shell_word(word: impl AsRef<OsStr>) -> String {
    let word = word.as_ref();
    let plain = |c: char| c.is_alphanumeric() && !is_hidden(c) || "/._-+:,@".contains(c);
    match word.to_str() {
        Some(text) if !text.is_empty() && text.chars().all(plain) => text.to_owned(),
        Some(text) if !text.chars().any(is_hidden) => {
            format!("'{}'", text.replace('\'', r"'\''"))
        }
        _ => printf_word(word.as_encoded_bytes()),
    }
}

/// Quotes an argument as output of `printf`. The shell drops line breaks at the end of a command's
/// output, so they are appended after it.
fn printf_word(word: &[u8]) -> String {
    let line_ends = word.iter().rev().take_while(|&&byte| byte == b'\n').count();
    let mut code = String::from("\"$(printf '");
    let empty = code.len();
    for chunk in word[..word.len() - line_ends].utf8_chunks() {
        for c in chunk.valid().chars() {
            // `printf` would take a first dash for a flag.
            let is_flag = c == '-' && code.len() == empty;
            let is_plain = c.is_alphanumeric() && !is_hidden(c) || " /._-+:,@=".contains(c);
            if is_plain && !is_flag {
                code.push(c);
            } else {
                octal(&mut code, c.encode_utf8(&mut [0; 4]).as_bytes());
            }
        }
        octal(&mut code, chunk.invalid());
    }
    code += "')\"";
    if line_ends > 0 {
        let _ = write!(code, "'{}'", "\n".repeat(line_ends));
    }
    code
}

fn octal(code: &mut String, bytes: &[u8]) {
    for byte in bytes {
        let _ = write!(code, "\\{byte:03o}");
    }
}

/// Quotes a path for a shell. Without the prefix `./`, a path that starts with a dash would be
/// taken for a flag.
#[must_use]
pub fn shell_path(path: &Path) -> String {
    if path.as_os_str().as_encoded_bytes().starts_with(b"-") {
        shell_word(Path::new(".").join(path))
    } else {
        shell_word(path)
    }
}

/// Error: the bytes are not UTF-8 text.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TextError {
    /// Text in UTF-16.
    #[error("the text is in UTF-16; save it as UTF-8")]
    Utf16,
    /// The bytes are not UTF-8.
    #[error("line {line}: byte {byte} of the file is not UTF-8; save it as UTF-8")]
    NotUtf8 {
        /// Line number, counted from 1.
        line: usize,
        /// Position of the byte in the file, counted from 1.
        byte: usize,
    },
}

/// Decodes a text file saved by any program: removes a byte order mark and ends all lines with
/// `\n`.
///
/// # Errors
/// [`TextError`] if the bytes are not UTF-8.
pub fn decode(bytes: &[u8]) -> Result<String, TextError> {
    // A UTF-16 byte order mark, or ASCII alternating with zeros. No valid UTF-8 file starts like
    // this.
    if matches!(
        bytes,
        [0xff, 0xfe, ..]
            | [0xfe, 0xff, ..]
            | [1..=127, 0, 1..=127, 0, ..]
            | [0, 1..=127, 0, 1..=127, ..]
    ) {
        return Err(TextError::Utf16);
    }
    let rest = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = std::str::from_utf8(rest).map_err(|error| {
        let before = &rest[..error.valid_up_to()];
        TextError::NotUtf8 {
            line: 1 + before.iter().filter(|&&byte| byte == b'\n').count(),
            byte: 1 + bytes.len() - rest.len() + before.len(),
        }
    })?;
    Ok(text.replace("\r\n", "\n"))
}
