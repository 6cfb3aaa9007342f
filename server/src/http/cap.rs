//! A cap on the bytes of a body as they come over the wire.
//!
//! What is beyond the cap is read on for a while and thrown away: a client that is still writing
//! when the connection is closed never sees the refusal, and would send the same again.

use std::pin::Pin;
use std::task::{Context, Poll};

use axum::body::{Body, Bytes, HttpBody};
use axum::extract::{Request, State};
use axum::middleware::Next;
use axum::response::Response;
use hyper::body::{Frame, SizeHint};

/// More than the cap was sent.
#[derive(Debug, thiserror::Error)]
#[error("the body is longer than {limit_bytes} bytes")]
pub(super) struct TooLong {
    pub(super) limit_bytes: usize,
}

/// How much is read on for, in caps.
const PATIENCE: usize = 4;

/// The layer: at most `limit_bytes` of a body get through.
pub(super) async fn cap(
    State(limit_bytes): State<usize>,
    request: Request,
    next: Next,
) -> Response {
    let capped = |body| Body::new(Capped { body, limit_bytes, seen_bytes: 0 });
    next.run(request.map(capped)).await
}

struct Capped {
    body: Body,
    limit_bytes: usize,
    seen_bytes: usize,
}

impl HttpBody for Capped {
    type Data = Bytes;
    type Error = axum::BoxError;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Self::Error>>> {
        let limit_bytes = self.limit_bytes;
        let too_long = || Poll::Ready(Some(Err(TooLong { limit_bytes }.into())));
        loop {
            let frame = match Pin::new(&mut self.body).poll_frame(cx) {
                Poll::Pending => return Poll::Pending,
                Poll::Ready(Some(Ok(frame))) => frame,
                Poll::Ready(Some(Err(error))) => return Poll::Ready(Some(Err(error.into()))),
                Poll::Ready(None) if self.seen_bytes > limit_bytes => return too_long(),
                Poll::Ready(None) => return Poll::Ready(None),
            };
            let length = frame.data_ref().map_or(0, Bytes::len);
            self.seen_bytes = self.seen_bytes.saturating_add(length);
            if self.seen_bytes <= limit_bytes {
                return Poll::Ready(Some(Ok(frame)));
            }
            if self.seen_bytes > limit_bytes.saturating_mul(PATIENCE) {
                return too_long();
            }
        }
    }

    fn is_end_stream(&self) -> bool {
        self.seen_bytes <= self.limit_bytes && self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
