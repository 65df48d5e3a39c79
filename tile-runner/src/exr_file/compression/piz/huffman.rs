//! The Huffman codes of PIZ: canonical, with one more symbol that repeats the one before it.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Values of a 16-bit word.
pub(super) const VALUES: usize = 1 << 16;
/// Longest code: one bit less than the format has room for, so that it fits 64 bits beside 7 that wait for their byte.
const LONGEST: usize = 57;
/// In the table of lengths: this much more than 2 zeroes (up to 3 more), the rest of 6 bits being lengths.
const SHORT_ZEROES: u64 = 59;
/// In the table of lengths: 8 bits follow, this many zeroes more than [`FEW_ZEROES`].
const LONG_ZEROES: u64 = 63;
const FEW_ZEROES: usize = 6;
/// Numbers before the table: first and last symbol, bytes of the table, bits of the data, and a zero.
const HEAD: usize = 5 * size_of::<u32>();
/// What a run's length is stored in.
const RUN_BITS: u64 = 8;

/// The codes for some words, and how long those become.
pub(super) struct Huffman {
    codes: Vec<Code>,
    /// The first symbol that has a code.
    first: usize,
    /// The last one, which stands for repetition.
    repeat: usize,
    table: Vec<u8>,
    bits: u64,
}

#[derive(Clone, Copy, Default)]
struct Code {
    bits: u64,
    length: u64,
}

impl Huffman {
    /// The best codes for `words`; `None` if there are none, or more bits than the format can count.
    pub(super) fn of(words: &[u16]) -> Option<Self> {
        let mut counts = vec![0_u64; VALUES + 1];
        for word in words {
            counts[usize::from(*word)] += 1;
        }
        let first = counts.iter().position(|&count| count > 0)?;
        let repeat = counts.iter().rposition(|&count| count > 0)? + 1;
        counts[repeat] = 1;
        let lengths = lengths(&counts)?;
        let table = pack(&lengths[first..=repeat]);
        let mut codes = Self {
            codes: canonical(&lengths),
            first,
            repeat,
            table,
            bits: 0,
        };
        let mut bits = 0;
        for_each_run(words, |word, repeats| {
            bits += codes.run(word, repeats).bits()
        });
        codes.bits = bits;
        i32::try_from(bits).is_ok().then_some(codes)
    }

    /// Bytes that [`write`](Self::write) appends.
    pub(super) fn bytes(&self) -> usize {
        HEAD + self.table.len() + self.bits.div_ceil(8) as usize
    }

    /// Appends the codes and `words`, for which they were made.
    pub(super) fn write(&self, words: &[u16], out: &mut Vec<u8>) {
        // all of them were found to fit
        let head = [
            self.first,
            self.repeat,
            self.table.len(),
            self.bits as usize,
            0,
        ];
        head.iter()
            .for_each(|&number| out.extend_from_slice(&(number as u32).to_le_bytes()));
        out.extend_from_slice(&self.table);
        let mut to = Bits::new(out);
        for_each_run(words, |word, repeats| {
            let run = self.run(word, repeats);
            (0..run.copies).for_each(|_| to.push(run.word.bits, run.word.length));
            if let Some(repeat) = run.repeat {
                to.push(repeat.bits, repeat.length);
                to.push(repeats, RUN_BITS);
            }
        });
        to.finish();
    }

    /// How a word and its repetitions are written: whichever is shorter.
    fn run(&self, word: u16, repeats: u64) -> Run {
        let (word, repeat) = (self.codes[usize::from(word)], self.codes[self.repeat]);
        match word.length + repeat.length + RUN_BITS < word.length * repeats {
            true => Run {
                word,
                copies: 1,
                repeat: Some(repeat),
            },
            false => Run {
                word,
                copies: 1 + repeats,
                repeat: None,
            },
        }
    }
}

/// A word so many times, or once and a code for its repetitions.
struct Run {
    word: Code,
    copies: u64,
    repeat: Option<Code>,
}

impl Run {
    fn bits(&self) -> u64 {
        let repeat = self.repeat.map_or(0, |code| code.length + RUN_BITS);
        self.word.length * self.copies + repeat
    }
}

/// Tells each word with how many times it is repeated, at most 255.
fn for_each_run(words: &[u16], mut tell: impl FnMut(u16, u64)) {
    for run in words.chunk_by(|a, b| a == b) {
        for run in run.chunks(256) {
            tell(run[0], run.len() as u64 - 1);
        }
    }
}

/// The length of each symbol's code. `None` if one is too long for the format: more words than any chunk has.
fn lengths(counts: &[u64]) -> Option<Vec<usize>> {
    let mut above = vec![0_usize; counts.len()];
    let leaves = counts.iter().zip(0..).filter(|(count, _)| **count > 0);
    let mut heap: BinaryHeap<Reverse<(u64, usize)>> = leaves
        .map(|(&count, node)| Reverse((count, node)))
        .collect();
    while let (Some(Reverse((a, left))), Some(Reverse((b, right)))) = (heap.pop(), heap.pop()) {
        let node = above.len();
        above.push(0);
        (above[left], above[right]) = (node, node);
        heap.push(Reverse((a + b, node)));
    }
    // a node is made after those below it, the root last
    let root = above.len() - 1;
    let mut depth = vec![0_usize; above.len()];
    for node in (0..root).rev().filter(|&node| above[node] > 0) {
        depth[node] = depth[above[node]] + 1;
    }
    depth.truncate(counts.len());
    (depth.iter().max() <= Some(&LONGEST)).then_some(depth)
}

/// Codes in the order of their symbols; longer ones are numerically lower.
fn canonical(lengths: &[usize]) -> Vec<Code> {
    let mut next = [0_u64; LONGEST + 1];
    lengths.iter().for_each(|&length| next[length] += 1);
    let mut code = 0;
    for next in next[1..].iter_mut().rev() {
        let count = std::mem::replace(next, code);
        code = (code + count) >> 1;
    }
    let assign = |&length: &usize| {
        if length == 0 {
            return Code::default();
        }
        let bits = next[length];
        next[length] += 1;
        Code {
            bits,
            length: length as u64,
        }
    };
    lengths.iter().map(assign).collect()
}

/// Lengths in 6 bits each, and runs of zeroes shortened.
fn pack(lengths: &[usize]) -> Vec<u8> {
    let mut table = Vec::new();
    let mut to = Bits::new(&mut table);
    for run in lengths.chunk_by(|a, b| *a == 0 && *b == 0) {
        for run in run.chunks(FEW_ZEROES + 255) {
            match run.len() {
                1 => to.push(run[0] as u64, 6),
                count if count < FEW_ZEROES => to.push(SHORT_ZEROES + count as u64 - 2, 6),
                count => {
                    to.push(LONG_ZEROES, 6);
                    to.push((count - FEW_ZEROES) as u64, 8);
                }
            }
        }
    }
    to.finish();
    table
}

/// Appends bits, the highest first.
struct Bits<'a> {
    out: &'a mut Vec<u8>,
    held: u64,
    count: u64,
}

impl<'a> Bits<'a> {
    fn new(out: &'a mut Vec<u8>) -> Self {
        Self {
            out,
            held: 0,
            count: 0,
        }
    }

    fn push(&mut self, bits: u64, count: u64) {
        // at most 7 are held
        self.held = self.held << count | bits;
        self.count += count;
        while self.count >= 8 {
            self.count -= 8;
            self.out.push((self.held >> self.count) as u8);
        }
    }

    fn finish(self) {
        if self.count > 0 {
            self.out.push((self.held << (8 - self.count)) as u8);
        }
    }
}
