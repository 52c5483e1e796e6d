//! `--tev`: pictures for the image viewer tev, decoded by a listener that knows its protocol.

use std::collections::BTreeMap;
use std::io::Read;
use std::net::{TcpListener, TcpStream};
use std::thread::JoinHandle;

use lumbre_report::exr;

use super::workplace::Workplace;

/// Images by name: width, height, names and interleaved values of the channels.
type Images = BTreeMap<String, (u32, u32, Vec<String>, Vec<f32>)>;

/// Fields of a packet.
struct Packet<'a>(&'a [u8]);

impl Packet<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let (head, rest) = self.0.split_first_chunk::<N>().unwrap();
        self.0 = rest;
        *head
    }

    fn number(&mut self) -> u32 {
        u32::from_le_bytes(self.bytes())
    }

    fn long(&mut self) -> u64 {
        u64::from_le_bytes(self.bytes())
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|byte| *byte == 0).unwrap();
        let text = String::from_utf8(self.0[..end].to_vec()).unwrap();
        self.0 = &self.0[end + 1..];
        text
    }
}

/// Applies one packet, without its length, as tev does.
fn apply(images: &mut Images, packet: &[u8]) {
    let mut packet = Packet(packet);
    let [kind, grabs_focus] = packet.bytes();
    assert_eq!(grabs_focus, 0);
    let name = packet.text();
    match kind {
        4 => {
            let (width, height, count) = (packet.number(), packet.number(), packet.number());
            let channels: Vec<String> = (0..count).map(|_| packet.text()).collect();
            let values = vec![0.0; (width * height * count) as usize];
            images.insert(name, (width, height, channels, values));
        }
        6 => {
            let count = packet.number() as usize;
            let names: Vec<String> = (0..count).map(|_| packet.text()).collect();
            let [x, y, w, h] = [(); 4].map(|()| packet.number());
            let offsets: Vec<u64> = (0..count).map(|_| packet.long()).collect();
            let strides: Vec<u64> = (0..count).map(|_| packet.long()).collect();
            let values: Vec<f32> = packet
                .0
                .chunks_exact(4)
                .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                .collect();
            let (width, _, channels, pixels) = images.get_mut(&name).expect("it was created");
            assert_eq!((&names, x, w), (&*channels, 0, *width));
            for pixel in 0..u64::from(w * h) {
                for c in 0..count {
                    let at = (u64::from(y * w) + pixel) as usize * count + c;
                    pixels[at] = values[(offsets[c] + pixel * strides[c]) as usize];
                }
            }
        }
        other => panic!("packet of kind {other}"),
    }
}

/// Reads packets until the connection ends.
fn receive(mut stream: TcpStream) -> Images {
    let mut images = Images::new();
    let mut length = [0; 4];
    while stream.read_exact(&mut length).is_ok() {
        let mut packet = vec![0; u32::from_le_bytes(length) as usize - 4];
        stream.read_exact(&mut packet).unwrap();
        apply(&mut images, &packet);
    }
    images
}

/// Starts the viewer's side.
fn background<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> JoinHandle<T> {
    let thread = std::thread::Builder::new().name("tev".to_owned());
    thread.spawn(work).unwrap()
}

/// Listens for one connection; returns the address.
fn listen() -> (String, JoinHandle<Images>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let images = background(move || receive(listener.accept().unwrap().0));
    (address, images)
}

#[test]
fn the_last_picture_of_a_render_is_the_one_in_its_file() {
    let place = Workplace::new();
    let (address, images) = listen();
    // More pixels than one packet has.
    let args = [
        "render", "ball.scn", "--size", "1024x600", "--spp", "1", "-o", "a.exr", "--tev", &address,
    ];
    place.succeed(&args);
    let images = images.join().unwrap();
    let (width, height, channels, values) = &images["lumbre render"];
    assert_eq!((*width, *height), (1024, 600));
    assert_eq!(channels, &["R", "G", "B"]);
    let (written, _) = exr::decode(&std::fs::read(place.path("a.exr")).unwrap()).unwrap();
    assert_eq!(values, written.data.as_flattened());
}

#[test]
fn a_night_shows_pictures_references_and_error_maps() {
    let place = Workplace::new();
    place.write(
        "n.lua",
        r#"local x = experiment("n", { seed = 1 })
        x:axis("technique", { "bpt", "nee" })
        x:render(function(p)
          return { scene = "ball.scn", integrator = p.technique, resolution = { 12, 8 }, backend = "cpu" }
        end)
        x:reference { from = function() return { integrator = "nee" } end, stop = stop.samples(64) }
        x:measure { psnr = metric.psnr(), mse = metric.mse() }
        x:stop(stop.samples(4))
        return x"#,
    );
    let (address, images) = listen();
    place.succeed(&["run", "n.lua", "--no-tui", "--tev", &address]);
    let images = images.join().unwrap();
    let names: Vec<&String> = images.keys().collect();
    for technique in ["bpt", "nee"] {
        let name = format!("technique={technique}/rep=0");
        let final_picture = place
            .files("out/latest")
            .into_iter()
            .find(|f| f.contains(&format!("technique={technique}")) && f.ends_with("final.exr"));
        let file = std::fs::read(place.path(&final_picture.unwrap())).unwrap();
        let (written, _) = exr::decode(&file).unwrap();
        assert_eq!(images[&name].3, written.data.as_flattened(), "{names:?}");
        let (_, _, _, reference) = &images[&format!("{name} reference")];
        let (_, _, channels, errors) = &images[&format!("{name} mse")];
        assert_eq!(channels, &["Y"]);
        for (i, error) in errors.iter().enumerate() {
            let pixel = |data: &[f32]| data[3 * i..3 * i + 3].to_vec();
            let (a, b) = (pixel(&images[&name].3), pixel(reference));
            let mse: f32 = a.iter().zip(&b).map(|(a, b)| (a - b) * (a - b) / 3.0).sum();
            assert!((error - mse).abs() <= 1e-5 * mse.max(1e-6), "{error} {mse}");
        }
    }
    assert!(
        names
            .iter()
            .any(|name| name.starts_with("reference nee of"))
    );
}

#[test]
fn a_viewer_that_is_missing_or_closed_is_named() {
    let place = Workplace::new();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let args = [
        "render", "ball.scn", "--size", "512x512", "--spp", "8", "-o", "a.exr", "--tev", &address,
    ];
    // The first connection is closed at once: the picture is rendered all the same.
    let closed = background(move || drop(listener.accept()));
    let output = place.succeed(&args);
    closed.join().unwrap();
    assert!(
        output.stderr.contains("gets no more pictures"),
        "{}",
        output.stderr
    );
    // Now nothing listens.
    let message = place.fail(2, &args);
    assert!(
        message.contains("cannot connect to tev at 127.0.0.1:"),
        "{message}"
    );
    place.fail(2, &["render", "ball.scn", "--tev", "nowhere"]);
}
