//! Headless Chromium, controlled through its DevTools protocol: JSON messages, each followed by a
//! zero byte, over pipes, so that no port is opened.

use crate::tools::Missing;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Maximum duration of any operation.
const PATIENCE: Duration = Duration::from_secs(60);

/// A browser with one page, without a network.
#[derive(Debug)]
pub struct Browser {
    child: Child,
    requests: ChildStdin,
    messages: Receiver<Value>,
    last_id: u64,
    session: Option<String>,
    /// Events that pages have sent since the browser was started.
    events: Vec<Value>,
    _profile: TempDir,
}

/// Finds Chromium.
///
/// # Errors
/// [`Missing`] if Chromium is not installed.
pub fn chromium() -> Result<PathBuf, Missing> {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let names = ["chromium", "chromium-browser", "google-chrome"];
    std::env::split_paths(&folders)
        .flat_map(|folder| names.map(|name| folder.join(name)))
        .find(|program| program.is_file())
        .ok_or_else(|| Missing("no Chromium; on Debian: apt-get install chromium".to_owned()))
}

impl Browser {
    /// Starts the browser.
    ///
    /// # Panics
    /// If Chromium does not start.
    #[must_use]
    pub fn start(chromium: &Path) -> Self {
        let profile = TempDir::new().expect("a temporary folder");
        // The browser communicates on descriptors 3 and 4.
        let mut child = Command::new("sh")
            .args([
                "-c",
                r#"exec "$@" 3<&0 4>&1 </dev/null >/dev/null 2>&1"#,
                "sh",
            ])
            .arg(chromium)
            .args([
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-dev-shm-usage",
                "--disable-background-networking",
                "--disable-component-update",
                "--no-first-run",
                "--window-size=1280,900",
                // No network access, even if a page requests it.
                "--proxy-server=http://127.0.0.1:9",
                "--host-resolver-rules=MAP * ~NOTFOUND",
                "--remote-debugging-pipe",
            ])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg("about:blank")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the shell starts");
        let requests = child.stdin.take().expect("it is piped");
        let mut answers = BufReader::new(child.stdout.take().expect("it is piped"));
        let (sender, messages) = channel();
        std::thread::spawn(move || {
            let mut message = Vec::new();
            while matches!(answers.read_until(0, &mut message), Ok(1..)) {
                message.pop();
                let parsed = serde_json::from_slice(&message);
                if parsed.is_ok_and(|value: Value| sender.send(value).is_err()) {
                    break;
                }
                message.clear();
            }
        });
        let mut browser = Self {
            child,
            requests,
            messages,
            last_id: 0,
            session: None,
            events: Vec::new(),
            _profile: profile,
        };
        let page = browser.call("Target.createTarget", json!({ "url": "about:blank" }));
        let attached = browser.call(
            "Target.attachToTarget",
            json!({ "targetId": page["targetId"], "flatten": true }),
        );
        browser.session = attached["sessionId"].as_str().map(str::to_owned);
        for domain in ["Page", "Runtime", "Log", "Network"] {
            browser.call(&format!("{domain}.enable"), json!({}));
        }
        let offline = json!({
            "offline": true, "latency": 0, "downloadThroughput": -1, "uploadThroughput": -1,
        });
        browser.call("Network.emulateNetworkConditions", offline);
        browser
    }

    /// Sends a command and waits for its result.
    ///
    /// # Panics
    /// If no result arrives or the result is an error.
    pub fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.last_id += 1;
        let id = self.last_id;
        let mut message = json!({ "id": id, "method": method, "params": parameters });
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        let mut bytes = message.to_string().into_bytes();
        bytes.push(0);
        self.requests.write_all(&bytes).expect("Chromium listens");
        let deadline = Instant::now() + PATIENCE;
        loop {
            let mut message = self.receive(deadline, method);
            if message["id"] == id {
                assert!(message["error"].is_null(), "{method}: {message}");
                return message["result"].take();
            }
            self.events.push(message);
        }
    }

    fn receive(&mut self, deadline: Instant, waiting_for: &str) -> Value {
        let left = deadline.saturating_duration_since(Instant::now());
        let received = self.messages.recv_timeout(left);
        received.unwrap_or_else(|error| panic!("{waiting_for}: {error}"))
    }

    /// Opens a file and waits until it is loaded.
    ///
    /// # Panics
    /// If the page does not load.
    pub fn open(&mut self, path: &Path) {
        let path = path
            .canonicalize()
            .unwrap_or_else(|e| panic!("{e}: {path:?}"));
        let url = format!("file://{}", path.display());
        self.call("Page.navigate", json!({ "url": url }));
        let loaded =
            format!("document.readyState === 'complete' && location.href.startsWith('{url}')");
        self.wait_for(&loaded);
    }

    /// Evaluates an expression on the page; if the expression returns a promise, returns the value
    /// to which the promise resolves.
    ///
    /// # Panics
    /// If the expression throws, or its value has a different type.
    pub fn evaluate<T: serde::de::DeserializeOwned>(&mut self, expression: &str) -> T {
        let mut result = self.call(
            "Runtime.evaluate",
            json!({ "expression": expression, "awaitPromise": true, "returnByValue": true }),
        );
        assert!(
            result["exceptionDetails"].is_null(),
            "{expression}: {result}"
        );
        let value = result["result"]["value"].take();
        serde_json::from_value(value).unwrap_or_else(|error| panic!("{expression}: {error}"))
    }

    /// Waits until an expression is true.
    ///
    /// # Panics
    /// If the expression does not become true in time.
    pub fn wait_for(&mut self, expression: &str) {
        let deadline = Instant::now() + PATIENCE;
        while !self.evaluate::<bool>(expression) {
            assert!(Instant::now() < deadline, "never: {expression}");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Presses and releases a key: a character, or a name such as `ArrowLeft`.
    pub fn press(&mut self, key: &str) {
        self.press_with(key, 0);
    }

    /// Presses a key like [`Browser::press`], but with Shift held.
    pub fn press_shifted(&mut self, key: &str) {
        self.press_with(key, 8);
    }

    fn press_with(&mut self, key: &str, modifiers: u32) {
        let (code, number) = match key {
            "Tab" => (key, 9),
            "Enter" => (key, 13),
            "Escape" => (key, 27),
            " " => ("Space", 32),
            "End" => (key, 35),
            "Home" => (key, 36),
            "ArrowLeft" => (key, 37),
            "ArrowUp" => (key, 38),
            "ArrowRight" => (key, 39),
            "ArrowDown" => (key, 40),
            _ => ("", 0),
        };
        let text = match key {
            "Enter" => "\r",
            key if key.chars().count() == 1 => key,
            _ => "",
        };
        for kind in ["keyDown", "keyUp"] {
            let mut event = json!({
                "type": kind, "key": key, "code": code, "windowsVirtualKeyCode": number,
                "modifiers": modifiers,
            });
            if kind == "keyDown" && !text.is_empty() {
                event["text"] = json!(text);
            }
            self.call("Input.dispatchKeyEvent", event);
        }
    }

    /// Clicks a point of the window.
    pub fn click(&mut self, x: f64, y: f64) {
        for kind in ["mousePressed", "mouseReleased"] {
            let event = json!({ "type": kind, "x": x, "y": y, "button": "left", "clickCount": 1 });
            self.call("Input.dispatchMouseEvent", event);
        }
    }

    /// Resizes the window.
    pub fn resize(&mut self, width: u32, height: u32) {
        let size =
            json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        self.call("Emulation.setDeviceMetricsOverride", size);
    }

    /// Checks that no page has reported an error so far, and that no page has requested anything
    /// except files and data in the page.
    ///
    /// # Panics
    /// If a page has reported an error or requested anything else.
    pub fn assert_quiet(&mut self) {
        // All earlier events arrive before the reply to this command.
        let _: bool = self.evaluate("true");
        for event in &self.events {
            let details = &event["params"];
            match event["method"].as_str().unwrap_or_default() {
                "Runtime.exceptionThrown" => panic!("{event}"),
                "Runtime.consoleAPICalled" => {
                    assert!(
                        !["error", "warning", "assert"]
                            .contains(&details["type"].as_str().unwrap_or_default()),
                        "{event}"
                    );
                }
                "Log.entryAdded" => {
                    assert!(
                        !["error", "warning"]
                            .contains(&details["entry"]["level"].as_str().unwrap_or_default()),
                        "{event}"
                    );
                }
                "Network.requestWillBeSent" => {
                    let url = details["request"]["url"].as_str().unwrap_or_default();
                    let local = ["file:", "data:", "blob:", "about:"];
                    assert!(local.iter().any(|kind| url.starts_with(kind)), "{url}");
                }
                _ => {}
            }
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // On a request to close, Chromium waits for its other processes, so no process is still
        // writing to the profile when the profile is removed.
        let _ = self
            .requests
            .write_all(b"{\"id\":0,\"method\":\"Browser.close\"}\0");
        let deadline = Instant::now() + Duration::from_secs(10);
        while Instant::now() < deadline && matches!(self.child.try_wait(), Ok(None)) {
            std::thread::sleep(Duration::from_millis(10));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
