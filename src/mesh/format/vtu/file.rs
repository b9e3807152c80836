//! The arrays of a VTU file: their tags and the decoding of their numbers.

use super::super::Fault;
use super::super::binary::{self, Order, Scalar};
use super::super::text::Text;
use super::BASE64;
use base64::Engine as _;
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};
use std::cell::Cell;
use std::io::Read as _;

/// No stream of deflate grows by more than this factor (RFC 1951: 258 bytes from two bits).
const MOST_GROWTH: usize = 1040;

/// Where an array belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Points,
    Cells,
    PointData,
    CellData,
}

/// How an array's numbers are written.
#[derive(Clone, Copy, Debug)]
pub(super) enum Form {
    Ascii,
    Inline,
    Appended(usize),
}

/// An array as its tag describes it.
#[derive(Debug)]
pub(super) struct Array {
    /// Where the tag stands.
    pub(super) at: usize,
    pub(super) name: String,
    pub(super) part: Part,
    scalar: Scalar,
    pub(super) components: usize,
    form: Form,
    /// The text between the tags.
    start: usize,
    end: usize,
}

/// A file whose numbers are still to be decoded.
pub(super) struct File<'a> {
    bytes: &'a [u8],
    order: Order,
    header: Scalar,
    compressed: bool,
    pub(super) points: usize,
    pub(super) cells: usize,
    pub(super) arrays: Vec<Array>,
    /// Where the appended data start, and whether they are raw.
    appended: Option<(usize, bool)>,
    pub(super) notices: Vec<String>,
    /// The bytes of all arrays decoded so far, as they stand in the file.
    decoded: Cell<usize>,
}

impl<'a> File<'a> {
    pub(super) fn parse(bytes: &'a [u8]) -> Result<File<'a>, Fault> {
        let mut file = File {
            bytes,
            order: Order::Little,
            header: Scalar::UInt32,
            compressed: false,
            points: 0,
            cells: 0,
            arrays: Vec::new(),
            appended: None,
            notices: Vec::new(),
            decoded: Cell::new(0),
        };
        let mut reader = Reader::from_reader(bytes);
        let mut part = None;
        let mut pieces = 0;
        let mut seen_file = false;
        // How deep we are within an array, and whether its text has been seen; it may hold other elements.
        let mut array_open = false;
        let mut inner = 0_usize;
        loop {
            let at = reader.buffer_position() as usize;
            let event = reader.read_event().map_err(|error| {
                Fault::text(reader.error_position() as usize, format!("the XML is damaged: {error}"))
            })?;
            let empty = matches!(event, Event::Empty(_));
            match event {
                Event::Start(tag) | Event::Empty(tag) => match tag.name().as_ref() {
                    _ if array_open => inner += usize::from(!empty),
                    b"VTKFile" => {
                        seen_file = true;
                        file.read_file_tag(&tag, at)?;
                    }
                    b"Piece" => {
                        pieces += 1;
                        if pieces > 1 {
                            return Err(Fault::text(
                                at,
                                "a second piece; only files of one piece are read, merge them (VTK: vtkAppendFilter)",
                            ));
                        }
                        file.points = count_attribute(&tag, at, "NumberOfPoints")?;
                        file.cells = count_attribute(&tag, at, "NumberOfCells")?;
                    }
                    b"Points" => part = Some(Part::Points),
                    b"Cells" => part = Some(Part::Cells),
                    b"PointData" => part = Some(Part::PointData),
                    b"CellData" => part = Some(Part::CellData),
                    b"FieldData" => {
                        part = None;
                        file.notices
                            .push("data of the whole file (FieldData) left out".to_string());
                    }
                    b"DataArray" | b"Array" => {
                        if let Some(part) = part {
                            file.read_array_tag(&tag, at, part, reader.buffer_position() as usize)?;
                        }
                        array_open = !empty;
                        inner = 0;
                    }
                    b"AppendedData" => {
                        let raw = match attribute(&tag, at, "encoding")?.as_deref() {
                            Some("raw") => true,
                            Some("base64") | None => false,
                            Some(other) => {
                                return Err(Fault::text(
                                    at,
                                    format!("the encoding {other:?} is unknown; raw and base64 are read"),
                                ));
                            }
                        };
                        let from = reader.buffer_position() as usize;
                        let mark = bytes[from..].iter().position(|&byte| byte == b'_');
                        let mark = mark.ok_or_else(|| {
                            Fault::text(at, "the appended data do not start with '_'; the file is cut off")
                        })?;
                        file.appended = Some((from + mark + 1, raw));
                        // What follows need not be XML.
                        break;
                    }
                    _ => {}
                },
                Event::Text(text) if array_open && inner == 0 => {
                    let blank = text.trim_ascii().is_empty();
                    if let Some(array) = file.arrays.last_mut()
                        && !blank
                        && array.end == array.start
                    {
                        (array.start, array.end) = (at, reader.buffer_position() as usize);
                    }
                }
                Event::End(tag) => match tag.name().as_ref() {
                    b"DataArray" | b"Array" if inner == 0 => array_open = false,
                    _ if array_open => inner = inner.saturating_sub(1),
                    b"Points" | b"Cells" | b"PointData" | b"CellData" => part = None,
                    _ => {}
                },
                Event::Eof => break,
                _ => {}
            }
        }
        if !seen_file {
            return Err(Fault::whole(
                "this is XML, but not a VTK file: there is no element VTKFile",
            ));
        }
        if pieces == 0 {
            return Err(Fault::whole(
                "there is no element Piece with points and cells; the file is cut off",
            ));
        }
        Ok(file)
    }

    fn read_file_tag(&mut self, tag: &BytesStart<'_>, at: usize) -> Result<(), Fault> {
        match attribute(tag, at, "type")?.as_deref() {
            Some("UnstructuredGrid") => {}
            other => {
                return Err(Fault::text(
                    at,
                    format!(
                        "the VTK file holds {}; only UnstructuredGrid (.vtu) is read",
                        other.unwrap_or("data of no named type")
                    ),
                ));
            }
        }
        self.order = match attribute(tag, at, "byte_order")?.as_deref() {
            Some("BigEndian") => Order::Big,
            Some("LittleEndian") | None => Order::Little,
            Some(other) => {
                return Err(Fault::text(
                    at,
                    format!("the byte order {other:?} is unknown; write LittleEndian or BigEndian"),
                ));
            }
        };
        self.header = match attribute(tag, at, "header_type")?.as_deref() {
            Some("UInt64") => Scalar::UInt64,
            Some("UInt32") | None => Scalar::UInt32,
            Some(other) => {
                return Err(Fault::text(
                    at,
                    format!("the header type {other:?} is unknown; write UInt32 or UInt64"),
                ));
            }
        };
        self.compressed = match attribute(tag, at, "compressor")?.as_deref() {
            None | Some("") => false,
            Some("vtkZLibDataCompressor") => true,
            Some(other) => {
                return Err(Fault::text(
                    at,
                    format!(
                        "the compressor {other} is not known; write the file with vtkZLibDataCompressor or without one"
                    ),
                ));
            }
        };
        Ok(())
    }

    fn read_array_tag(&mut self, tag: &BytesStart<'_>, at: usize, part: Part, start: usize) -> Result<(), Fault> {
        let name = attribute(tag, at, "Name")?.unwrap_or_default();
        let scalar = match attribute(tag, at, "type")?.as_deref() {
            Some("Int8") => Scalar::Int8,
            Some("UInt8") => Scalar::UInt8,
            Some("Int16") => Scalar::Int16,
            Some("UInt16") => Scalar::UInt16,
            Some("Int32") => Scalar::Int32,
            Some("UInt32") => Scalar::UInt32,
            Some("Int64") => Scalar::Int64,
            Some("UInt64") => Scalar::UInt64,
            Some("Float32") => Scalar::Float32,
            Some("Float64") => Scalar::Float64,
            Some("String") if matches!(part, Part::PointData | Part::CellData) => {
                self.notices.push(format!("the field {name:?} of strings left out"));
                return Ok(());
            }
            Some(other) => {
                return Err(Fault::text(
                    at,
                    format!("the number type {other:?} of array {name:?} is unknown"),
                ));
            }
            None => return Err(Fault::text(at, format!("the array {name:?} has no attribute type"))),
        };
        let components = match attribute(tag, at, "NumberOfComponents")?.as_deref() {
            None | Some("") => 1,
            Some(text) => match text.trim().parse() {
                Ok(count @ 1..=1_000_000) => count,
                _ => {
                    return Err(Fault::text(
                        at,
                        format!("NumberOfComponents of array {name:?} is {text:?}; write a number from 1"),
                    ));
                }
            },
        };
        let form = match attribute(tag, at, "format")?.as_deref() {
            Some("ascii") | None => Form::Ascii,
            Some("binary") => Form::Inline,
            Some("appended") => Form::Appended(count_attribute(tag, at, "offset")?),
            Some(other) => {
                return Err(Fault::text(
                    at,
                    format!("the format {other:?} of array {name:?} is unknown; write ascii, binary or appended"),
                ));
            }
        };
        self.arrays.push(Array {
            at,
            name,
            part,
            scalar,
            components,
            form,
            start,
            end: start,
        });
        Ok(())
    }

    pub(super) fn cell_array(&self, name: &str) -> Result<&Array, Fault> {
        self.arrays
            .iter()
            .find(|array| array.part == Part::Cells && array.name == name)
            .ok_or_else(|| Fault::whole(format!("the cells have no array {name:?}; the file is incomplete")))
    }

    /// The numbers of an array of `rows` rows.
    pub(super) fn reals(&self, array: &Array, rows: usize, finite: bool) -> Result<Vec<f64>, Fault> {
        let count = self.length(array, rows)?;
        if let Form::Ascii = array.form {
            let name = &array.name;
            self.ascii(array, count, |text, row| {
                let what = format_args!("number {row} of array {name:?}");
                if finite { text.finite(what) } else { text.real(what) }
            })
        } else {
            let bytes = self.decode(array, count)?;
            Ok(binary::reals(array.scalar, self.order, &bytes))
        }
    }

    /// The integers of an array of `count` numbers.
    pub(super) fn integers(&self, array: &Array, count: usize) -> Result<Vec<i64>, Fault> {
        if let Form::Ascii = array.form {
            let name = &array.name;
            self.ascii(array, count, |text, row| {
                text.integer(format_args!("integer {row} of array {name:?}"))
            })
        } else {
            let bytes = self.decode(array, count)?;
            binary::integers(array.scalar, self.order, &bytes).ok_or_else(|| {
                Fault::text(
                    array.at,
                    format!("the array {:?} holds real numbers; integers are expected", array.name),
                )
            })
        }
    }

    fn length(&self, array: &Array, rows: usize) -> Result<usize, Fault> {
        rows.checked_mul(array.components).ok_or_else(|| {
            Fault::text(
                array.at,
                format!(
                    "the array {:?} would hold {rows} x {} numbers; correct the count",
                    array.name, array.components
                ),
            )
        })
    }

    fn ascii<T>(
        &self,
        array: &Array,
        count: usize,
        mut next: impl FnMut(&mut Text<'_>, usize) -> Result<T, Fault>,
    ) -> Result<Vec<T>, Fault> {
        let mut text = Text::part(self.bytes, array.start, array.end, None);
        if count > text.remaining().div_ceil(2) {
            return Err(Fault::text(
                array.at,
                format!(
                    "the array {:?} should hold {count} numbers, but its text has {} bytes; correct the count or restore the text",
                    array.name,
                    text.remaining()
                ),
            ));
        }
        let mut values = Vec::with_capacity(count);
        for row in 0..count {
            values.push(next(&mut text, row)?);
        }
        match text.word() {
            None => Ok(values),
            Some(_) => Err(Fault::text(
                text.at(),
                format!(
                    "the array {:?} holds more than the {count} numbers that are expected",
                    array.name
                ),
            )),
        }
    }

    /// The bytes of an array of `count` numbers in binary form.
    fn decode(&self, array: &Array, count: usize) -> Result<Vec<u8>, Fault> {
        let fault = |message: String| Fault::text(array.at, format!("the array {:?} {message}", array.name));
        let wanted = count
            .checked_mul(array.scalar.size())
            .ok_or_else(|| fault(format!("would hold {count} numbers; correct the count")))?;
        let decoded;
        let data: &[u8] = match (array.form, self.appended) {
            (Form::Appended(_), None) => {
                return Err(fault(
                    "refers to appended data, but there are none; the file is cut off".to_string(),
                ));
            }
            (Form::Appended(offset), Some((start, raw))) => {
                let all = &self.bytes[start..];
                let own = all.get(offset..).ok_or_else(|| {
                    fault(format!(
                        "starts at {offset}, beyond the {} appended bytes; the file is cut off",
                        all.len()
                    ))
                })?;
                if raw {
                    own
                } else {
                    decoded = self
                        .decode_base64(own, self.next_offset(offset).map(|next| next - offset))
                        .map_err(fault)?;
                    &decoded
                }
            }
            (Form::Inline | Form::Ascii, _) => {
                decoded = self
                    .decode_base64(&self.bytes[array.start..array.end], None)
                    .map_err(fault)?;
                &decoded
            }
        };
        let number = |index: usize| -> Option<usize> {
            let size = self.header.size();
            let bytes = data.get(index.checked_mul(size)?..(index + 1).checked_mul(size)?)?;
            let value = binary::integers(self.header, self.order, bytes)?;
            usize::try_from(*value.first()?).ok()
        };
        let cut = || fault("is cut off or damaged; restore the file".to_string());
        let contradiction = |found: usize| {
            fault(format!(
                "holds {found} bytes, {count} x {} are expected; correct the count or restore the file",
                array.scalar.size()
            ))
        };
        if !self.compressed {
            let length = number(0).ok_or_else(cut)?;
            if length != wanted {
                return Err(contradiction(length));
            }
            self.account(length).map_err(fault)?;
            let body = &data[self.header.size()..];
            return body.get(..length).map(<[u8]>::to_vec).ok_or_else(cut);
        }

        let (blocks, block, last) = match (number(0), number(1), number(2)) {
            (Some(blocks), Some(block), Some(last)) => (blocks, block, last),
            // An empty array may have a header of one zero.
            (Some(0), ..) => (0, 0, 0),
            _ => return Err(cut()),
        };
        if blocks > data.len() / self.header.size() {
            return Err(cut());
        }
        let whole_blocks = blocks.saturating_sub(usize::from(last > 0));
        let total = whole_blocks.checked_mul(block).and_then(|size| size.checked_add(last));
        let total = if blocks == 0 { Some(0) } else { total };
        if total != Some(wanted) {
            return Err(contradiction(total.unwrap_or(usize::MAX)));
        }
        let start = (3 + blocks) * self.header.size();
        let mut end = start;
        let mut blocks_at = Vec::with_capacity(blocks);
        for index in 0..blocks {
            let next = number(3 + index).and_then(|size| end.checked_add(size));
            let next = next.filter(|&next| next <= data.len()).ok_or_else(cut)?;
            blocks_at.push(end..next);
            end = next;
        }
        self.account(end).map_err(fault)?;
        if wanted > (end - start).saturating_mul(MOST_GROWTH) {
            return Err(cut());
        }
        let mut values = Vec::with_capacity(wanted);
        for (index, range) in blocks_at.into_iter().enumerate() {
            let size = if index < whole_blocks { block } else { last };
            let before = values.len();
            flate2::read::ZlibDecoder::new(&data[range])
                .take(size as u64)
                .read_to_end(&mut values)
                .map_err(|error| fault(format!("cannot be decompressed ({error}); restore the file")))?;
            if values.len() - before != size {
                return Err(cut());
            }
        }
        Ok(values)
    }

    /// Keeps arrays that share their place from multiplying the file: the sum of all may be twice its size (base64,
    /// decoded).
    fn account(&self, bytes: usize) -> Result<(), String> {
        self.decoded.set(self.decoded.get().saturating_add(bytes));
        if self.decoded.get() > 2 * self.bytes.len() {
            return Err("overlaps other arrays; each array needs its own place".to_string());
        }
        Ok(())
    }

    /// The smallest offset of an appended array beyond `offset`.
    fn next_offset(&self, offset: usize) -> Option<usize> {
        let offsets = self.arrays.iter().filter_map(|array| match array.form {
            Form::Appended(other) if other > offset => Some(other),
            _ => None,
        });
        offsets.min()
    }

    /// Decodes base64 in which padded pieces follow one another, up to `length` letters or the next tag.
    fn decode_base64(&self, text: &[u8], length: Option<usize>) -> Result<Vec<u8>, String> {
        let text = &text[..length.unwrap_or(text.len()).min(text.len())];
        let end = text.iter().position(|&byte| byte == b'<').unwrap_or(text.len());
        self.account(end)?;
        let mut letters = text[..end].to_vec();
        letters.retain(|byte| !byte.is_ascii_whitespace());
        let mut decoded = Vec::with_capacity(letters.len() / 4 * 3 + 3);
        let mut rest = &letters[..];
        while !rest.is_empty() {
            let padding = rest.iter().position(|&byte| byte == b'=').unwrap_or(rest.len());
            let after = padding + rest[padding..].iter().take_while(|&&byte| byte == b'=').count();
            BASE64
                .decode_vec(&rest[..padding], &mut decoded)
                .map_err(|error| format!("is no valid base64 ({error}); restore the file"))?;
            rest = &rest[after..];
        }
        Ok(decoded)
    }
}

fn attribute(tag: &BytesStart<'_>, at: usize, name: &str) -> Result<Option<String>, Fault> {
    let damaged = |error: &dyn std::fmt::Display| Fault::text(at, format!("the XML is damaged: {error}"));
    let found = tag.try_get_attribute(name).map_err(|error| damaged(&error))?;
    match found {
        None => Ok(None),
        Some(found) => {
            let value = found
                .normalized_value(XmlVersion::Implicit1_0)
                .map_err(|error| damaged(&error))?;
            Ok(Some(value.into_owned()))
        }
    }
}

fn count_attribute(tag: &BytesStart<'_>, at: usize, name: &str) -> Result<usize, Fault> {
    let text = attribute(tag, at, name)?.unwrap_or_default();
    text.trim()
        .parse()
        .map_err(|_| Fault::text(at, format!("{name} is {text:?}; write a number from 0")))
}
