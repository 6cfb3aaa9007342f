//! A wire with a meter: forwards TCP connections and counts the bytes that pass, headers and all.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinHandle;

use crate::Error;

/// A metered wire to a server; dropping it cuts the wire.
#[derive(Debug)]
pub struct Meter {
    address: SocketAddr,
    counts: Arc<Counts>,
    accepting: JoinHandle<()>,
}

#[derive(Debug, Default)]
struct Counts {
    up: AtomicU64,
    down: AtomicU64,
}

impl Meter {
    /// A wire from a free port to the server at `target` (host and port).
    ///
    /// # Errors
    /// No port can be had.
    pub async fn to(target: &str) -> Result<Self, Error> {
        let fault = |e| Error::file("127.0.0.1:0", e);
        let listener = TcpListener::bind("127.0.0.1:0").await.map_err(fault)?;
        let address = listener.local_addr().map_err(fault)?;
        let counts = Arc::new(Counts::default());
        let (target, counting) = (target.to_owned(), Arc::clone(&counts));
        let accepting = tokio::spawn(async move {
            while let Ok((near, _)) = listener.accept().await {
                let (target, counts) = (target.clone(), Arc::clone(&counting));
                tokio::spawn(async move {
                    // A connection that fails closes; whoever called tries again.
                    if let Ok(far) = TcpStream::connect(&target).await {
                        forward(near, far, &counts).await;
                    }
                });
            }
        });
        Ok(Self { address, counts, accepting })
    }

    /// Where robots call instead of the server.
    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Bytes from the robots to the server so far.
    pub fn up(&self) -> u64 {
        self.counts.up.load(Ordering::Relaxed)
    }

    /// Bytes from the server to the robots so far.
    pub fn down(&self) -> u64 {
        self.counts.down.load(Ordering::Relaxed)
    }
}

impl Drop for Meter {
    fn drop(&mut self) {
        self.accepting.abort();
    }
}

async fn forward(near: TcpStream, far: TcpStream, counts: &Counts) {
    // Requests are small and answers wait for them: waiting to fill packets would be measured.
    let _ = (near.set_nodelay(true), far.set_nodelay(true));
    let (near_read, near_write) = near.into_split();
    let (far_read, far_write) = far.into_split();
    tokio::join!(pump(near_read, far_write, &counts.up), pump(far_read, near_write, &counts.down));
}

async fn pump(
    mut from: tokio::net::tcp::OwnedReadHalf,
    mut to: tokio::net::tcp::OwnedWriteHalf,
    count: &AtomicU64,
) {
    let mut buffer = vec![0; 64 * 1024];
    while let Ok(read) = from.read(&mut buffer).await {
        if read == 0 || to.write_all(&buffer[..read]).await.is_err() {
            break;
        }
        count.fetch_add(read as u64, Ordering::Relaxed);
    }
    let _ = to.shutdown().await;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn every_byte_passes_and_is_counted_by_direction() {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let target = listener.local_addr().unwrap().to_string();
        let server = tokio::spawn(async move {
            let (mut stream, _) = listener.accept().await.unwrap();
            let mut question = [0; 5];
            stream.read_exact(&mut question).await.unwrap();
            stream.write_all(b"an answer").await.unwrap();
        });
        let meter = Meter::to(&target).await.unwrap();
        let mut robot = TcpStream::connect(meter.address).await.unwrap();
        robot.write_all(b"hello").await.unwrap();
        let mut answer = String::new();
        robot.read_to_string(&mut answer).await.unwrap();
        server.await.unwrap();
        assert_eq!(answer, "an answer");
        assert_eq!((meter.up(), meter.down()), (5, 9));
    }
}
