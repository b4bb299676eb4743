//! The server's thread: the page's files and its WebSockets, with a bound on everything.

use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;
use std::time::Duration;

use axum::Router;
use axum::extract::ws::{Utf8Bytes, WebSocketUpgrade};
use axum::extract::{Request, State};
use axum::http::header::{self, HeaderName};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use tokio::time::{Instant, sleep};

use super::bounded::Bounded;
use super::guard::{Guard, Refusal, token};
use super::inbox::Said;
use super::picture::{Map, Picture};
use super::shared::{Published, Shared};
use super::socket;
use host::clock::since_boot;

/// For the pages to hear that the program ends.
const GOODBYE: Duration = Duration::from_millis(300);
/// Largest message of a page, bytes.
const MESSAGE: usize = 512;

const INDEX: &str = include_str!("page/index.html");
const STYLE: &str = include_str!("page/style.css");
const SCRIPT: &str = include_str!("page/view.js");
const BODIES: &str = include_str!("page/bodies.js");

/// A server that runs.
#[derive(Debug)]
pub(super) struct Server {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Starts on a thread of its own. Returns the page's address, too.
    pub(super) fn start(listener: TcpListener) -> std::io::Result<(Self, String)> {
        let at = listener.local_addr()?;
        listener.set_nonblocking(true)?;
        let shared = Arc::new(Shared::new(Guard::new(at, token()?)));
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .build()?;
        let listener = {
            let _entered = runtime.enter();
            tokio::net::TcpListener::from_std(listener)?
        };
        let served = Arc::clone(&shared);
        let thread = std::thread::Builder::new()
            .name("page".to_owned())
            .spawn(move || {
                runtime.block_on(serve(listener, served));
                runtime.shutdown_timeout(GOODBYE);
            })?;
        let address = shared.guard.address(at);
        let thread = Some(thread);
        Ok((Self { shared, thread }, address))
    }

    pub(super) fn watching(&self) -> usize {
        self.shared.open.load(Ordering::Relaxed)
    }

    pub(super) fn show(&self, picture: &Picture) {
        let before = self
            .shared
            .pictures
            .borrow()
            .as_ref()
            .map_or(0, |p| p.number);
        let number = before + 1;
        let message = serde_json::json!({"is": "picture", "number": number, "picture": picture});
        self.shared.pictures.send_replace(Some(Published {
            number,
            at: since_boot(),
            text: message.to_string().into(),
        }));
    }

    pub(super) fn show_map(&self, map: &Map) {
        let message = serde_json::json!({"is": "map", "map": map});
        let text = Utf8Bytes::from(message.to_string());
        self.shared.map.send_replace(Some(text));
    }

    pub(super) fn said(&self) -> impl Iterator<Item = Said> + use<> {
        self.shared.inbox.take().into_iter()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.shared.over.send_replace(true);
        if let Some(thread) = self.thread.take() {
            // It ends by itself within its time; what it panicked of was printed.
            let _ = thread.join();
        }
    }
}

async fn serve(listener: tokio::net::TcpListener, shared: Arc<Shared>) {
    let mut over = shared.over.subscribe();
    let served = axum::serve(Bounded::new(listener), router(Arc::clone(&shared)));
    tokio::select! {
        _ = served => {}
        _ = over.wait_for(|over| *over) => {}
    }
    let end = Instant::now() + GOODBYE;
    while shared.open.load(Ordering::Relaxed) > 0 && Instant::now() < end {
        sleep(Duration::from_millis(5)).await;
    }
}

fn router(shared: Arc<Shared>) -> Router {
    let file = |kind: &'static str, text: &'static str| {
        get(move || async move { ([(header::CONTENT_TYPE, kind)], text) })
    };
    Router::new()
        .route("/{token}/", file("text/html; charset=utf-8", INDEX))
        .route("/{token}/style.css", file("text/css; charset=utf-8", STYLE))
        .route(
            "/{token}/view.js",
            file("text/javascript; charset=utf-8", SCRIPT),
        )
        .route(
            "/{token}/bodies.js",
            file("text/javascript; charset=utf-8", BODIES),
        )
        .route("/{token}/socket", get(upgrade))
        .layer(middleware::from_fn_with_state(Arc::clone(&shared), check))
        .with_state(shared)
}

/// The one value of a header; a request that has it twice has none.
fn one<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    let mut values = headers.get_all(name).iter();
    let value = values.next()?.to_str().ok();
    value.filter(|_| values.next().is_none())
}

async fn check(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    let host = one(request.headers(), &header::HOST).map(str::to_owned);
    let named = request.uri().authority().map(|name| name.as_str());
    let allowed = match named {
        // A request line may name a host, too.
        Some(named) if host.as_deref() != Some(named) => Err(Refusal::Host),
        _ => shared.guard.check(host.as_deref(), request.uri().path()),
    };
    let mut response = match allowed {
        Ok(()) => next.run(request).await,
        Err(refusal) => refused(refusal),
    };
    let connect = host.unwrap_or_default();
    let policy = format!(
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src data:; connect-src 'self' ws://{connect}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    );
    let headers = response.headers_mut();
    if allowed.is_ok()
        && let Ok(policy) = HeaderValue::from_str(&policy)
    {
        headers.insert(header::CONTENT_SECURITY_POLICY, policy);
    }
    for (name, value) in [
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

fn refused(refusal: Refusal) -> Response {
    let words = match refusal {
        Refusal::Host => {
            "Refused: this name is not the page's. Open the address that gauntlet printed.\n"
        }
        Refusal::Token => {
            "Refused: the address lacks its token. Open the whole address that gauntlet printed.\n"
        }
        Refusal::Origin => {
            "Refused: only the page itself may connect. Open the address that gauntlet printed.\n"
        }
    };
    (StatusCode::FORBIDDEN, words).into_response()
}

async fn upgrade(
    State(shared): State<Arc<Shared>>,
    headers: HeaderMap,
    socket: WebSocketUpgrade,
) -> Response {
    let host = one(&headers, &header::HOST).unwrap_or_default();
    match Guard::check_origin(host, one(&headers, &header::ORIGIN)) {
        Ok(()) => socket
            .max_message_size(MESSAGE)
            .max_frame_size(MESSAGE)
            .on_upgrade(|socket| socket::serve(socket, shared)),
        Err(refusal) => refused(refusal),
    }
}
