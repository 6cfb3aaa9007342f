//! The accept loop: who may connect, and how long they may keep a connection without using it.
//!
//! HTTP/1.1 only: nothing here encrypts, browsers and robots speak HTTP/2 only over TLS, and a
//! proxy that adds TLS speaks HTTP/1.1 inwards. It also leaves no protocol to be guessed, for
//! which the guessing server has no timeout.

use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, watch};

use crate::config::HttpLimits;

/// Largest head of a request, bytes.
const HEAD_BYTES_MAX: usize = 16 << 10;
/// Most headers of a request.
const HEADERS_MAX: usize = 64;
/// Pause after a failed accept (as a rule: no file descriptors left).
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);

/// Serves connections until `closing` becomes true; then finishes what is in flight, for at most
/// the drain timeout.
pub async fn serve(
    listener: TcpListener,
    router: Router,
    limits: HttpLimits,
    mut closing: watch::Receiver<bool>,
) {
    let connections = Arc::new(Semaphore::new(limits.connections_max));
    let graceful = GracefulShutdown::new();
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new())
        .header_read_timeout(limits.head_timeout())
        .max_header_size(HEAD_BYTES_MAX)
        .max_headers(HEADERS_MAX);
    let closed = closed(&mut closing, limits.drain_delay());
    tokio::pin!(closed);
    loop {
        let accepted = tokio::select! {
            accepted = accept(&listener, &connections) => accepted,
            () = &mut closed => break,
        };
        let Some((stream, permit)) = accepted else { continue };
        let service = TowerToHyperService::new(router.clone());
        let connection = graceful.watch(http.serve_connection(TokioIo::new(stream), service));
        tokio::spawn(async move {
            if let Err(error) = connection.await {
                tracing::debug!(%error, "connection ended");
            }
            drop(permit);
        });
    }
    drop(listener);
    if tokio::time::timeout(limits.drain_timeout(), graceful.shutdown()).await.is_err() {
        tracing::warn!("some requests did not finish in time and were cut off");
    }
}

/// Resolves some time after `closing` became true.
async fn closed(closing: &mut watch::Receiver<bool>, delay: Duration) {
    // A sender that is gone has closed too.
    let _: Result<_, watch::error::RecvError> = closing.wait_for(|closing| *closing).await;
    tokio::time::sleep(delay).await;
}

/// The next connection, once there is room for one.
async fn accept(
    listener: &TcpListener,
    connections: &Arc<Semaphore>,
) -> Option<(TcpStream, tokio::sync::OwnedSemaphorePermit)> {
    let permit = Arc::clone(connections).acquire_owned().await.ok()?;
    match listener.accept().await {
        Ok((stream, _)) => {
            // Small answers must not wait for more to send; failing to say so costs only time.
            let _: Result<(), std::io::Error> = stream.set_nodelay(true);
            Some((stream, permit))
        }
        Err(error) => {
            tracing::warn!(%error, "cannot accept");
            tokio::time::sleep(ACCEPT_PAUSE).await;
            None
        }
    }
}
