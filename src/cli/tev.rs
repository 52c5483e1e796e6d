//! Pictures in the image viewer tev while they are rendered: `--tev HOST:PORT`.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::time::Duration;

use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

use super::exit::Failure;
use lumbre_light::film::{Image, SharedImage};
use lumbre_night::experiment::event::{Event, Sink, SinkError};
use lumbre_night::experiment::{CellRef, Night};

/// Longest time that a connection or a write may take.
const PATIENCE: Duration = Duration::from_secs(5);

/// Largest number of pixels in one packet.
const PIXELS_OF_PACKET: usize = 1 << 19;

/// Connection to tev. A connection that breaks is reported once; later pictures are discarded.
pub struct Tev {
    /// `None` after an error.
    client: Option<TevClient>,
    address: String,
    /// Names of the pictures that tev has.
    created: BTreeSet<String>,
}

impl Tev {
    /// Connects to tev at `HOST:PORT`; tev itself listens at 127.0.0.1:14158.
    ///
    /// # Errors
    /// Fails if the address is invalid or nothing listens there.
    pub fn connect(address: &str) -> Result<Tev, Failure> {
        let open = || -> io::Result<TcpStream> {
            let mut last = io::Error::other("the address has no host");
            for resolved in address.to_socket_addrs()? {
                match TcpStream::connect_timeout(&resolved, PATIENCE) {
                    Ok(stream) => {
                        stream.set_write_timeout(Some(PATIENCE))?;
                        return Ok(stream);
                    }
                    Err(e) => last = e,
                }
            }
            Err(last)
        };
        let stream = open().map_err(|e| {
            Failure::usage(format!(
                "cannot connect to tev at {address}: {e}; start tev, whose address is \
                 127.0.0.1:14158 unless --hostname changes it"
            ))
        })?;
        Ok(Tev {
            client: Some(TevClient::wrap(stream)),
            address: address.to_owned(),
            created: BTreeSet::new(),
        })
    }

    /// Shows a picture under a name, in place of an earlier one with this name and size.
    pub fn show(&mut self, name: &str, image: &Image) {
        let channels = image.data.as_flattened();
        self.send(
            name,
            [image.width, image.height],
            &["R", "G", "B"],
            channels,
        );
    }

    /// Sends an image whose channels are interleaved.
    fn send(&mut self, name: &str, size: [u32; 2], channels: &[&str], data: &[f32]) {
        let Some(client) = &mut self.client else {
            return;
        };
        if data.is_empty() {
            return;
        }
        let is_new = self.created.insert(format!("{name} {size:?}"));
        let sent = (|| {
            if is_new {
                client.send(PacketCreateImage {
                    image_name: name,
                    grab_focus: false,
                    width: size[0],
                    height: size[1],
                    channel_names: channels,
                })?;
            }
            send_rows(client, name, size[0], channels, data)
        })();
        if let Err(e) = sent {
            self.client = None;
            let address = &self.address;
            tracing::warn!("tev at {address} gets no more pictures: {e}");
        }
    }
}

/// Sends the pixels of an image in bands of rows.
fn send_rows(
    client: &mut TevClient,
    name: &str,
    width: u32,
    channels: &[&str],
    data: &[f32],
) -> io::Result<()> {
    let count = channels.len();
    let rows = (PIXELS_OF_PACKET / width as usize).max(1);
    let offsets: Vec<u64> = (0..count as u64).collect();
    let mut y = 0;
    for band in data.chunks(rows * width as usize * count) {
        let height = (band.len() / count) as u32 / width;
        client.send(PacketUpdateImage {
            image_name: name,
            grab_focus: false,
            channel_names: channels,
            channel_offsets: &offsets,
            channel_strides: &vec![count as u64; count],
            x: 0,
            y,
            width,
            height,
            data: band,
        })?;
        y += height;
    }
    Ok(())
}

/// Sends the pictures of a night to tev between waves, outside the clock of every run: the picture
/// of a run, its reference, and its map of the first metric that has one.
pub struct TevSink {
    tev: Tev,
    night: Night,
    /// References of the runs that are open.
    references: BTreeMap<CellRef, SharedImage>,
}

impl TevSink {
    /// Creates the sink of a night.
    pub fn new(tev: Tev, night: Night) -> TevSink {
        TevSink {
            night,
            tev,
            references: BTreeMap::new(),
        }
    }

    /// Shows the picture of a run and its error.
    fn show(&mut self, cell: CellRef, image: &Image) {
        let name = self.night.path(cell);
        self.tev.show(&name, image);
        let Some(reference) = self.references.get(&cell) else {
            return;
        };
        let metrics = self.night.plan.metrics.iter();
        let mut maps = metrics.filter(|spec| spec.row.map.is_some());
        let map = maps.next().and_then(|spec| {
            let map = spec.error_map(image, reference).ok()?;
            Some((format!("{name} {}", spec.column), map))
        });
        if let Some((name, map)) = map {
            let size = [map.width, map.height];
            self.tev.send(&name, size, &["Y"], &map.values);
        }
    }
}

impl Sink for TevSink {
    fn receive(&mut self, event: &Event) -> Result<(), SinkError> {
        match event {
            Event::CellStarted {
                cell,
                reference: Some(reference),
                ..
            } => {
                let name = format!("{} reference", self.night.path(*cell));
                self.tev.show(&name, reference);
                self.references.insert(*cell, Arc::clone(reference));
            }
            Event::Wave {
                cell,
                image: Some(image),
                ..
            } => self.show(*cell, image),
            Event::CellFinished { cell, .. } => {
                self.references.remove(cell);
            }
            _ => {}
        }
        Ok(())
    }
}
