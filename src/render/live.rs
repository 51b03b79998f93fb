//! The picture while it is made, in a running tev (the image viewer by Thomas Müller), over its network protocol.
//!
//! A thread of its own connects and sends. The render leaves a copy of the colours for it when the last one has gone out,
//! and otherwise goes on: a viewer that is slow, hangs or goes away costs it nothing.

use std::{
    net::{TcpStream, ToSocketAddrs as _},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread,
    time::{Duration, Instant},
};

use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

use crate::film::Film;

const CHANNELS: [&str; 4] = ["R", "G", "B", "A"];
/// Longest wait for a connection, and for a viewer that takes nothing.
const PATIENCE: Duration = Duration::from_secs(5);
/// Least time between two pictures, so that copying them is nothing beside rendering.
const PAUSE: Duration = Duration::from_millis(200);
/// Longest wait for the last picture to go out.
const FAREWELL: Duration = Duration::from_secs(1);
/// Rows of one packet.
const BAND: usize = 64;

/// Colours and alpha of a film, row by row.
struct Frame {
    width: usize,
    height: usize,
    rgba: Vec<f32>,
}

impl Frame {
    fn new(film: &Film) -> Self {
        let pixels = (0..film.height).flat_map(|y| (0..film.width).map(move |x| film.pixel(x, y)));
        let rgba = pixels.flat_map(|p| [p.color[0], p.color[1], p.color[2], p.alpha]).collect();
        Self { width: film.width as usize, height: film.height as usize, rgba }
    }
}

/// What render and sender share.
#[derive(Default)]
struct Desk {
    /// The picture that goes out next.
    next: Option<Frame>,
    /// Whether one is going out.
    sending: bool,
    /// No more will come.
    closing: bool,
    /// The sender has ended.
    ended: bool,
    /// Why, if not because it was told to.
    problem: Option<String>,
}

#[derive(Default)]
struct Shared {
    desk: Mutex<Desk>,
    changed: Condvar,
}

impl Shared {
    fn desk(&self) -> MutexGuard<'_, Desk> {
        self.desk.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A connection to a viewer, or to where one should be.
pub(crate) struct LiveView {
    shared: Arc<Shared>,
    last: Option<Instant>,
}

impl LiveView {
    /// Starts to connect to `address`, as in `localhost:14158`; `name` is what the viewer calls the picture.
    pub(crate) fn connect(address: &str, name: &str) -> Self {
        let shared = Arc::new(Shared::default());
        let (address, name, theirs) = (address.to_owned(), name.replace('\0', ""), Arc::clone(&shared));
        thread::spawn(move || {
            let result = send_all(&address, &name, &theirs);
            let mut desk = theirs.desk();
            desk.problem = result.err();
            desk.ended = true;
            theirs.changed.notify_all();
        });
        Self { shared, last: None }
    }

    /// Shows what a film holds, unless an older picture is still waiting to go out.
    pub(crate) fn show(&mut self, film: &Film) {
        let early = self.last.is_some_and(|last| last.elapsed() < PAUSE);
        let desk = self.shared.desk();
        if early || desk.ended || desk.next.is_some() {
            return;
        }
        drop(desk);
        self.last = Some(Instant::now());
        self.shared.desk().next = Some(Frame::new(film));
        self.shared.changed.notify_all();
    }

    /// Shows the finished picture, and waits a moment for it to go out. Returns why the viewer does not have it.
    pub(crate) fn finish(self, film: &Film) -> Option<String> {
        let until = Instant::now() + FAREWELL;
        if !self.shared.desk().ended {
            let frame = Frame::new(film);
            self.shared.desk().next = Some(frame);
        }
        let mut desk = self.shared.desk();
        desk.closing = true;
        self.shared.changed.notify_all();
        while !desk.ended {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Some("it takes the picture too slowly".to_owned());
            }
            desk = self.shared.changed.wait_timeout(desk, left).unwrap_or_else(PoisonError::into_inner).0;
        }
        desk.problem.take()
    }
}

/// Sends every picture that is left on the desk until told to close.
fn send_all(address: &str, name: &str, shared: &Shared) -> Result<(), String> {
    let mut client = TevClient::wrap(connect(address)?);
    let mut is_first = true;
    loop {
        let mut desk = shared.desk();
        desk.sending = false;
        while desk.next.is_none() {
            if desk.closing {
                return Ok(());
            }
            desk = shared.changed.wait(desk).unwrap_or_else(PoisonError::into_inner);
        }
        let Some(frame) = desk.next.take() else { continue };
        desk.sending = true;
        drop(desk);
        send(&mut client, name, &frame, is_first).map_err(|e| format!("it no longer takes the picture: {e}"))?;
        is_first = false;
    }
}

/// Sends one picture, which the viewer must make room for first.
fn send(client: &mut TevClient, image_name: &str, frame: &Frame, is_first: bool) -> std::io::Result<()> {
    let width = frame.width as u32;
    if is_first {
        let height = frame.height as u32;
        let channel_names = &CHANNELS;
        client.send(PacketCreateImage { image_name, grab_focus: false, width, height, channel_names })?;
    }
    let row = frame.width * CHANNELS.len();
    for (band, data) in frame.rgba.chunks(BAND * row).enumerate() {
        client.send(PacketUpdateImage {
            image_name,
            grab_focus: false,
            channel_names: &CHANNELS,
            channel_offsets: &[0, 1, 2, 3],
            channel_strides: &[4; 4],
            x: 0,
            y: (band * BAND) as u32,
            width,
            height: (data.len() / row) as u32,
            data,
        })?;
    }
    Ok(())
}

fn connect(address: &str) -> Result<TcpStream, String> {
    let places = address.to_socket_addrs().map_err(|e| format!("no such address: {e}"))?;
    let mut problem = "no such address".to_owned();
    for place in places {
        match TcpStream::connect_timeout(&place, PATIENCE) {
            Ok(stream) => {
                // Fails only for a wait of zero.
                let _ = stream.set_write_timeout(Some(PATIENCE));
                return Ok(stream);
            }
            Err(error) => problem = error.to_string(),
        }
    }
    Err(problem)
}

#[cfg(test)]
mod tests {
    use std::{io::Read as _, net::TcpListener};

    use super::*;
    use crate::{film::Sample, math::Rgb, scene::Layers};

    fn film(value: f32) -> Film {
        let mut film = Film::new([3, 5, 803, 605], Layers::NONE, 1.0).unwrap();
        for tile in film.tiles_in_order() {
            for y in 0..tile.height {
                for x in 0..tile.width {
                    let radiance = Rgb::splat(value + (tile.x + x) as f32);
                    tile.add(x, y, &Sample { radiance, alpha: 1.0, ..Sample::default() });
                }
            }
        }
        film
    }

    fn server() -> (TcpListener, String) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        (listener, address)
    }

    /// Reads a number of the protocol.
    fn word<const N: usize>(bytes: &mut &[u8]) -> [u8; N] {
        let (word, rest) = bytes.split_first_chunk::<N>().expect("the packet goes on");
        *bytes = rest;
        *word
    }

    fn text(bytes: &mut &[u8]) -> String {
        let end = bytes.iter().position(|&b| b == 0).expect("text ends");
        let text = String::from_utf8(bytes[..end].to_vec()).unwrap();
        *bytes = &bytes[end + 1..];
        text
    }

    #[test]
    fn a_viewer_gets_the_picture() {
        let (listener, address) = server();
        let reader = thread::spawn(move || {
            let mut bytes = Vec::new();
            listener.accept().unwrap().0.read_to_end(&mut bytes).unwrap();
            bytes
        });
        let mut view = LiveView::connect(&address, "hat\0.toml");
        view.show(&film(1000.0));
        assert_eq!(view.finish(&film(0.0)), None);
        let bytes = reader.join().unwrap();
        let mut rest = bytes.as_slice();
        let mut picture = vec![f32::NAN; 800 * 600 * 4];
        let mut created = 0;
        while !rest.is_empty() {
            let size = u32::from_le_bytes(*rest.first_chunk::<4>().unwrap()) as usize;
            let (mut packet, after) = (&rest[4..size], &rest[size..]);
            rest = after;
            let [kind, _focus] = word(&mut packet);
            assert_eq!(text(&mut packet), "hat.toml");
            let number = |p: &mut &[u8]| u32::from_le_bytes(word(p)) as usize;
            if kind == 4 {
                assert_eq!([number(&mut packet), number(&mut packet), number(&mut packet)], [800, 600, 4]);
                created += 1;
                continue;
            }
            assert_eq!(kind, 6, "an update of the third kind");
            assert_eq!(number(&mut packet), 4);
            let names = [(); 4].map(|()| text(&mut packet));
            assert_eq!(names, CHANNELS);
            let [x, y, width, height] = [(); 4].map(|()| number(&mut packet));
            assert_eq!((x, width), (0, 800));
            packet = &packet[8 * 8..];
            let (floats, _) = packet.as_chunks::<4>();
            assert_eq!(floats.len(), width * height * 4);
            for (to, from) in picture[y * 3200..].iter_mut().zip(floats) {
                *to = f32::from_le_bytes(*from);
            }
        }
        assert_eq!(created, 1);
        for (i, pixel) in picture.as_chunks::<4>().0.iter().enumerate() {
            let value = 3.0 + (i % 800) as f32;
            assert_eq!(*pixel, [value, value, value, 1.0], "pixel {i} of the last picture");
        }
    }

    #[test]
    fn a_viewer_that_never_reads_is_left_behind() {
        let (listener, address) = server();
        let mut view = LiveView::connect(&address, "hat");
        let _open = listener.accept().unwrap();
        let film = film(0.0);
        for _ in 0..3 {
            view.show(&film);
            // Past the pause between pictures: what stands in the way is the viewer alone.
            view.last = None;
        }
        assert!(view.shared.desk().next.is_some() || view.shared.desk().sending);
        let waited = Instant::now();
        let problem = view.finish(&film).expect("a picture of 7 MB does not fit into the network's buffers");
        assert!(problem.contains("too slowly"), "{problem}");
        assert!(waited.elapsed() < PATIENCE, "the farewell is short");
    }

    #[test]
    fn a_viewer_that_goes_away_is_forgotten() {
        let (listener, address) = server();
        let mut view = LiveView::connect(&address, "hat");
        drop(listener.accept().unwrap());
        drop(listener);
        let film = film(0.0);
        let started = Instant::now();
        while !view.shared.desk().ended && started.elapsed() < Duration::from_secs(20) {
            view.last = None;
            view.show(&film);
            thread::sleep(Duration::from_millis(5));
        }
        let problem = view.finish(&film).expect("nobody is there");
        assert!(problem.starts_with("it no longer takes the picture"), "{problem}");
    }

    #[test]
    fn where_no_viewer_is_the_reason_is_told() {
        let (listener, address) = server();
        drop(listener);
        assert!(LiveView::connect(&address, "hat").finish(&film(0.0)).is_some());
        assert!(LiveView::connect("no port", "hat").finish(&film(0.0)).is_some());
    }
}
