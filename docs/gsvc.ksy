# The syntax of GSVC for Kaitai Struct (https://kaitai.io): informative; spec.md alone is normative.
#
# It reads what legal streams say, down to the bits of planes. It checks neither rules nor checksums, and it does not
# decode: the symbols of a coded plane stay words. So how many ones a coded `survivor_map` has is unknown to it, and what
# depends on that is in `not_parsed`: the rest of that frame, and of the P-frames behind it up to the next I-frame.
# Frames of profile `main` are read down to the lane states and words of their run.
#
# The ids are the names of spec.md; an id with `repeat` is a run. A test parses all vectors and compares the names.
meta:
  id: gsvc
  title: GSVC, video as 2D Gaussian splats
  file-extension: gsvc
  license: MIT
  ks-version: '0.11'
  endian: le
  bit-endian: be
doc-ref: spec.md
seq:
  - id: magic
    contents: [0x89, 0x47, 0x53, 0x56, 0x43, 0x0d, 0x0a, 0x1a]
  - id: version_major
    type: u1
  - id: version_minor
    type: u1
  - id: chunk
    type: chunk(_index)
    repeat: until
    repeat-until: _.chunk_type == type_of_chunk::end
instances:
  header:
    value: chunk[0].payload.as<sequence_header>
enums:
  type_of_chunk:
    0x48: sequence_header
    0x49: intra_frame
    0x50: predicted_frame
    0x52: repeated_frame
    0x45: end
    0x78: index
    0x6e: layer
  type_of_payload:
    0: unknown
    1: sequence_header
    2: frame
    3: main_frame
    4: layer
    5: index
    6: end
  mode_of_plane:
    0: constant
    1: raw
    2: coded
  format_of_chroma:
    0: rgb
    1: yuv_420
    2: yuv_422
    3: yuv_444
types:
  chunk:
    params:
      - id: place
        type: s4
    seq:
      - id: chunk_type
        type: u1
        enum: type_of_chunk
      - id: chunk_length
        type: uv
      - id: payload
        size: chunk_length.value
        type:
          switch-on: kind
          cases:
            'type_of_payload::sequence_header': sequence_header
            'type_of_payload::frame': frame(place)
            'type_of_payload::main_frame': main_frame
            'type_of_payload::layer': layer
            'type_of_payload::index': index
            'type_of_payload::end': end
      - id: chunk_crc
        type: u4
      - id: never
        type: b1
        if: last_frame < 0
        doc: Never there; the condition makes that `last_frame` is known before it is needed.
    instances:
      is_frame:
        value: >-
          chunk_type == type_of_chunk::intra_frame or chunk_type == type_of_chunk::predicted_frame
          or chunk_type == type_of_chunk::repeated_frame
      kind:
        value: >-
          chunk_type == type_of_chunk::sequence_header ? type_of_payload::sequence_header
          : chunk_type == type_of_chunk::index ? type_of_payload::index
          : chunk_type == type_of_chunk::end ? type_of_payload::end
          : is_frame ? (_root.header.profile == 0 ? type_of_payload::frame : type_of_payload::main_frame)
          : chunk_type == type_of_chunk::layer and is_of_a_main_frame ? type_of_payload::layer
          : type_of_payload::unknown
      is_of_a_main_frame:
        value: >-
          _root.header.profile == 1 and _root.header.main_header.layer_count > 1
          and _root.chunk[place - 1].last_frame.as<s4> > 0
        doc: Whether a chunk belongs to a frame of profile main with layers; only chunks after the header ask for it.
      last_frame:
        value: 'is_frame or place == 0 ? place : _root.chunk[place - 1].last_frame.as<s4>'
        doc: The place of the last chunk of a frame, this one included.
  uv:
    doc: LEB128, at most 5 bytes (section 3.1).
    seq:
      - id: group
        type: group
        repeat: until
        repeat-until: not _.more
    instances:
      value:
        value: >-
          group[0].bits + (group.size > 1 ? group[1].bits * 128 : 0) + (group.size > 2 ? group[2].bits * 16384 : 0)
          + (group.size > 3 ? group[3].bits * 2097152 : 0) + (group.size > 4 ? group[4].bits * 268435456 : 0)
    types:
      group:
        seq:
          - id: more
            type: b1
          - id: bits
            type: b7
  sequence_header:
    seq:
      - id: profile
        type: u1
      - id: level
        type: u1
      - id: flags
        type: u1
      - id: width
        type: u2
      - id: height
        type: u2
      - id: frame_rate_numerator
        type: u4
      - id: frame_rate_denominator
        type: u4
      - id: sample_aspect_numerator
        type: u2
      - id: sample_aspect_denominator
        type: u2
      - id: frame_count
        type: u4
      - id: bit_depth
        type: u1
      - id: chroma_format
        type: u1
        enum: format_of_chroma
      - id: color_primaries
        type: u1
      - id: transfer_characteristics
        type: u1
      - id: matrix_coefficients
        type: u1
      - id: video_full_range_flag
        type: u1
      - id: chroma_sample_loc_type
        type: u1
      - id: cholesky_bits
        type: u1
        if: profile == 0
      - id: color_stages
        type: u1
        if: profile == 0
      - id: color_codewords
        type: u2
        if: profile == 0
      - id: entropy_precision
        type: u1
        if: profile == 0
      - id: lane_count
        type: u1
        if: profile == 0
      - id: main_header
        type: main_header
        if: profile == 1
      - id: unknown
        size-eos: true
        doc: What a later minor version adds (R-6.1-6).
    instances:
      parameter_checksum_flag:
        value: (flags & 1) == 1
  main_header:
    seq:
      - id: max_lane_exponent
        type: u1
      - id: layer_count
        type: u1
      - id: main_tools
        type: u1
      - id: quality
        type: quality
        repeat: expr
        repeat-expr: layer_count
        if: layer_count > 1
    types:
      quality:
        seq:
          - id: quality_level
            type: b3
          - id: quality_halvings
            type: b2
          - id: quality_reserved
            type: b3
  frame:
    params:
      - id: place
        type: s4
    seq:
      - id: frame_number
        type: uv
      - id: parameter_checksum
        type: u4
        if: _root.header.parameter_checksum_flag
      - id: splat_count
        type: uv
        if: is_intra
      - id: new_splat_count
        type: uv
        if: is_predicted
      - id: survivor_map
        type: plane(reference_count, 2)
        if: is_predicted and reference_count > 0
      - id: inter_block
        type: splat_block(survivor_count, false)
        if: survivor_count > 0
      - id: intra_block
        type: splat_block(intra_count, true)
        if: is_complete and intra_count > 0
      - id: never
        type: b1
        if: splats < -1 or inter_codebooks_at < 0 or intra_codebooks_at < 0
        doc: Never there; the condition makes that these are known before later frames need them.
      - id: not_parsed
        size-eos: true
        doc: What depends on the symbols of a coded `survivor_map`; empty in complete frames.
    instances:
      is_intra:
        value: _parent.chunk_type == type_of_chunk::intra_frame
      is_predicted:
        value: _parent.chunk_type == type_of_chunk::predicted_frame
      before:
        value: _root.chunk[_root.chunk[place - 1].last_frame].payload.as<frame>
        doc: The frame before; only P- and R-frames ask for it.
      reference_count:
        value: 'is_intra ? 0 : before.splats.as<s4>'
        doc: Splats of the frame before; -1 if unknown.
      is_complete:
        value: >-
          is_intra or (reference_count >= 0 and (not is_predicted or reference_count == 0
          or survivor_map.head.plane_mode != mode_of_plane::coded))
        doc: Whether nothing of it, nor of the frames that it needs, is in `not_parsed`.
      survivor_count:
        value: 'is_predicted and is_complete and reference_count > 0 ? survivor_map.ones : 0'
      intra_count:
        value: 'is_intra ? splat_count.value : is_predicted ? new_splat_count.value : 0'
      splats:
        value: >-
          not is_complete ? -1 : is_intra or is_predicted ? survivor_count + intra_count : reference_count
        doc: Splats of this frame; -1 if unknown.
      inter_codebooks_at:
        value: >-
          is_intra ? 0 : survivor_count > 0 and inter_block.codebooks_present ? place : before.inter_codebooks_at.as<s4>
        doc: The place of the chunk whose inter block has the codebooks that are kept; 0 for none.
      intra_codebooks_at:
        value: >-
          is_complete and intra_count > 0 and intra_block.codebooks_present ? place
          : is_intra ? 0 : before.intra_codebooks_at.as<s4>
        doc: The place of the chunk whose intra block has the codebooks that are kept; 0 for none.
  splat_block:
    params:
      - id: count
        type: s4
      - id: is_intra
        type: bool
    seq:
      - id: positions_present
        type: b1
      - id: cholesky_present
        type: b1
      - id: quantizer_present
        type: b1
      - id: colors_present
        type: b1
      - id: codebooks_present
        type: b1
      - id: block_reserved
        type: b3
      - id: axis
        type: axis(count)
        repeat: expr
        repeat-expr: 2
        if: positions_present
        doc: x and y.
      - id: channel
        type: channel(count, quantizer_present)
        repeat: expr
        repeat-expr: 3
        if: cholesky_present
        doc: l11, l21 and l22.
      - id: codebooks
        type: codebooks
        if: codebooks_present
      - id: color_index
        type: plane(count, used_codebooks.stage[_index].codeword_count)
        repeat: expr
        repeat-expr: used_codebooks.stage_count
        if: colors_present
    instances:
      used_codebooks:
        value: >-
          codebooks_present ? codebooks
          : is_intra ? _root.chunk[_parent.before.intra_codebooks_at].payload.as<frame>.intra_block.codebooks
          : _root.chunk[_parent.before.inter_codebooks_at].payload.as<frame>.inter_block.codebooks
        doc: Those of the block, or the kept ones (R-6.5-8).
  axis:
    params:
      - id: count
        type: s4
    seq:
      - id: position_high
        type: plane(count, 256)
      - id: position_low
        type: plane(count, 256)
  channel:
    params:
      - id: count
        type: s4
      - id: has_quantizer
        type: bool
    seq:
      - id: cholesky_scale
        type: f4
        if: has_quantizer
      - id: cholesky_offset
        type: f4
        if: has_quantizer
      - id: cholesky_code
        type: plane(count, 1 << _root.header.cholesky_bits)
  codebooks:
    seq:
      - id: stage_count
        type: u1
      - id: stage
        type: stage
        repeat: expr
        repeat-expr: stage_count
    types:
      stage:
        seq:
          - id: codeword_count
            type: u2
          - id: codeword
            type: u2
            repeat: expr
            repeat-expr: 3 * codeword_count
            doc: Patterns of binary16; R, G, B of each codeword.
  plane:
    params:
      - id: count
        type: s4
      - id: alphabet
        type: s4
    seq:
      - id: head
        type: head
      - id: symbol
        type: symbol(w, _index)
        repeat: expr
        repeat-expr: 'head.plane_mode == mode_of_plane::constant ? 1 : count'
        if: head.plane_mode != mode_of_plane::coded
      - id: coded
        type: coded(count, w)
        if: head.plane_mode == mode_of_plane::coded
      - id: align
        type: align
    instances:
      w:
        value: >-
          alphabet <= 1 ? 0 : alphabet <= 2 ? 1 : alphabet <= 4 ? 2 : alphabet <= 8 ? 3 : alphabet <= 16 ? 4
          : alphabet <= 32 ? 5 : alphabet <= 64 ? 6 : alphabet <= 128 ? 7 : alphabet <= 256 ? 8
          : alphabet <= 512 ? 9 : alphabet <= 1024 ? 10 : alphabet <= 2048 ? 11 : 12
        doc: The least integer with 2^w >= alphabet.
      ones:
        value: 'head.plane_mode == mode_of_plane::constant ? symbol[0].sum * count : symbol[count - 1].sum'
        doc: The sum of all symbols of a plane that is not coded.
    types:
      head:
        doc: A type of its own, since what follows bits in one type begins at a byte.
        seq:
          - id: plane_mode
            type: b2
            enum: mode_of_plane
      symbol:
        params:
          - id: w
            type: s4
          - id: place
            type: s4
        seq:
          - id: bits
            type: u(w)
          - id: never
            type: b1
            if: sum < 0
            doc: Never there; the condition makes that `sum` is known before the next symbol needs it.
        instances:
          sum:
            value: 'bits.value + (place == 0 ? 0 : _parent.symbol[place - 1].sum.as<s4>)'
            doc: The sum of this symbol and of all before it.
      coded:
        params:
          - id: count
            type: s4
          - id: w
            type: s4
        seq:
          - id: table
            type: table
          - id: first_symbol
            type: u(w)
          - id: last_symbol
            type: u(w)
          - id: frequency
            type: eg(table.golomb_order)
            repeat: expr
            repeat-expr: last_symbol.value - first_symbol.value + 1
          - id: align
            type: align
          - id: word_count
            type: uv
          - id: lane_state
            type: u4
            repeat: expr
            repeat-expr: '_root.header.lane_count < count ? _root.header.lane_count : count'
          - id: word
            type: u2
            repeat: expr
            repeat-expr: word_count.value
      table:
        seq:
          - id: table_bits
            type: b5
          - id: golomb_order
            type: b4
  u:
    doc: An unsigned integer of w bits, of which there may be none.
    params:
      - id: w
        type: s4
    seq:
      - id: digit
        type: digit(_index)
        repeat: expr
        repeat-expr: w
    instances:
      value:
        value: 'w == 0 ? 0 : digit[w - 1].value'
    types:
      digit:
        params:
          - id: place
            type: s4
        seq:
          - id: bit
            type: b1
        instances:
          value:
            value: '(place == 0 ? 0 : _parent.digit[place - 1].value.as<s4> * 2) + bit.to_i'
            doc: The value of the integer up to this bit.
  eg:
    doc: An exponential Golomb code of order k.
    params:
      - id: k
        type: s4
    seq:
      - id: prefix
        type: prefix
      - id: r
        type: u(z + k)
    instances:
      z:
        value: prefix.bit.size - 1
      value:
        value: (((1 << z) - 1) << k) + r.value
    types:
      prefix:
        seq:
          - id: bit
            type: b1
            repeat: until
            repeat-until: _
  align:
    doc: align() of section 3.1.
    seq:
      - id: never
        type: b1
        if: false
      - id: aligned
        size: 0
  main_frame:
    seq:
      - id: frame_number
        type: uv
      - id: parameter_checksum
        type: u4
        if: _root.header.parameter_checksum_flag
      - id: layer_mask
        type: u1
        if: _root.header.main_header.layer_count > 1
      - id: body
        type: frame_body
        if: _parent.chunk_type != type_of_chunk::repeated_frame
  layer:
    seq:
      - id: layer
        type: b2
      - id: layer_type
        type: b2
        doc: 0 I, 1 P or 2 R.
      - id: frame_low
        type: b4
      - id: parameter_checksum
        type: u4
        if: _root.header.parameter_checksum_flag
      - id: body
        type: frame_body
        if: layer_type != 2
  frame_body:
    seq:
      - id: lane_exponent
        type: b4
      - id: motion_cell
        type: b2
      - id: quantizer_present
        type: b1
      - id: new_present
        type: b1
      - id: quantizer
        type: u1
        if: quantizer_present
      - id: splat_number
        type: uv
        if: new_present
      - id: densities
        type: densities
        if: 'new_present and splat_number.value % 2 == 1'
      - id: run
        type: run(lane_exponent)
        if: not _io.eof
        doc: Bytes are left if and only if there is a symbol.
  run:
    params:
      - id: exponent
        type: b4
    seq:
      - id: lane_state
        type: u4
        repeat: expr
        repeat-expr: 1 << exponent
      - id: word_count
        type: uv
        repeat: expr
        repeat-expr: '(1 << exponent) / 32 - 1'
        if: exponent > 5
        doc: Of each group of 32 lanes but the last.
      - id: words_and_raw_bytes
        size-eos: true
        doc: Where the words end only decoding tells; raw bits are read from the end.
  densities:
    seq:
      - id: density
        type: density(_index >= 1 and _index <= 4)
        repeat: expr
        repeat-expr: 6
        doc: Luma, chroma1, chroma2, size, aspect and shear.
      - id: halving_code
        type: b3
        repeat: expr
        repeat-expr: 2 * doublings
      - id: align
        type: align
    instances:
      longest:
        value: '(_root.header.width > _root.header.height ? _root.header.width : _root.header.height)'
        doc: The longer side of the frame.
      last_cell:
        value: (longest - 1) / 4
        doc: The number of the last cell along that side.
      doublings:
        value: >-
          last_cell < 1 ? 0 : last_cell < 2 ? 1 : last_cell < 4 ? 2 : last_cell < 8 ? 3 : last_cell < 16 ? 4
          : last_cell < 32 ? 5 : last_cell < 64 ? 6 : last_cell < 128 ? 7 : last_cell < 256 ? 8
          : last_cell < 512 ? 9 : last_cell < 1024 ? 10 : last_cell < 2048 ? 11 : last_cell < 4096 ? 12
          : last_cell < 8192 ? 13 : 14
        doc: The binary logarithm of the side of the square of cells.
    types:
      density:
        params:
          - id: is_sloped
            type: bool
        seq:
          - id: density_family
            type: b1
          - id: scale_code
            type: b5
          - id: centre
            type: b10
          - id: slope
            type: b8
            if: is_sloped
  index:
    seq:
      - id: entry_count
        type: uv
      - id: entry
        type: entry
        repeat: expr
        repeat-expr: entry_count.value
    types:
      entry:
        seq:
          - id: frame_number_step
            type: uv
          - id: offset_step
            type: uv
  end:
    seq:
      - id: frame_count
        type: u4
      - id: index_length
        type: u4
