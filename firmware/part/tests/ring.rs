//! Ring of the link between an interrupt and the program, here two threads.

use std::thread;

use echoloop_part::ring::Ring;

#[test]
fn a_full_ring_takes_nothing_and_loses_nothing_that_it_has() {
    let ring = Ring::<8>::new();
    for round in 0..5 {
        assert!((0..8).all(|byte| ring.push(round * 8 + byte)));
        assert!(!ring.push(99), "there is no room");
        assert!((0..8).all(|byte| ring.pop() == Some(round * 8 + byte)));
        assert!(ring.is_empty() && ring.pop().is_none());
    }
}

#[test]
fn bytes_come_out_as_they_went_in_while_both_sides_work() {
    const BYTES: usize = 300_000;
    static RING: Ring<16> = Ring::new();
    let byte = |n: usize| (n % 251) as u8;
    let writer = thread::spawn(move || {
        for n in 0..BYTES {
            while !RING.push(byte(n)) {
                thread::yield_now();
            }
        }
    });
    for n in 0..BYTES {
        let found = loop {
            match RING.pop() {
                Some(found) => break found,
                None => thread::yield_now(),
            }
        };
        assert_eq!(found, byte(n), "byte {n}");
    }
    writer.join().expect("the writer ends");
    assert!(RING.is_empty());
}
