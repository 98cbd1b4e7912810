/* Constants of GSVC 1.0-draft.2, by spec.md. Do not edit: `gsvc-conformance syntax --write` writes this file.
 * C99 or C++17: numbers with a fraction are hexadecimal, so that they have all their bits.
 */
#ifndef GSVC_H
#define GSVC_H

/* First bytes of a stream, as an initialiser. */
#define GSVC_MAGIC {0x89, 0x47, 0x53, 0x56, 0x43, 0x0D, 0x0A, 0x1A}
#define GSVC_MAGIC_SIZE 8 /* bytes */

/* Types of chunks. */
#define GSVC_CHUNK_H 0x48 /* sequence header */
#define GSVC_CHUNK_I 0x49 /* I-frame */
#define GSVC_CHUNK_P 0x50 /* P-frame */
#define GSVC_CHUNK_R 0x52 /* R-frame */
#define GSVC_CHUNK_E 0x45 /* end */
#define GSVC_CHUNK_ANCILLARY_X 0x78 /* index */
#define GSVC_CHUNK_ANCILLARY_D 0x64 /* decisions of the encoder */
#define GSVC_CHUNK_ANCILLARY_T 0x74 /* time stamps */
#define GSVC_CHUNK_ANCILLARY_P 0x70 /* private */
#define GSVC_CHUNK_ANCILLARY_Q 0x71 /* private */
#define GSVC_CHUNK_ANCILLARY_N 0x6E /* layer */
#define GSVC_CHUNK_ANCILLARY_R 0x72 /* private */
#define GSVC_CHUNK_ANCILLARY_S 0x73 /* private */

/* Ranges of elements: the least and the greatest legal value, where these are numbers. */
#define GSVC_VERSION_MAJOR_MIN 130
#define GSVC_VERSION_MAJOR_MAX 130
#define GSVC_PROFILE_MIN 0
#define GSVC_PROFILE_MAX 1
#define GSVC_LEVEL_MIN 1
#define GSVC_LEVEL_MAX 5
#define GSVC_FLAGS_MIN 0
#define GSVC_FLAGS_MAX 3
#define GSVC_WIDTH_MIN 1
#define GSVC_WIDTH_MAX 65535
#define GSVC_HEIGHT_MIN 1
#define GSVC_HEIGHT_MAX 65535
#define GSVC_FRAME_RATE_NUMERATOR_MIN 1
#define GSVC_FRAME_RATE_NUMERATOR_MAX 0xFFFFFFFFu
#define GSVC_FRAME_RATE_DENOMINATOR_MIN 1
#define GSVC_FRAME_RATE_DENOMINATOR_MAX 0xFFFFFFFFu
#define GSVC_BIT_DEPTH_MIN 8
#define GSVC_BIT_DEPTH_MAX 16
#define GSVC_CHROMA_FORMAT_MIN 0
#define GSVC_CHROMA_FORMAT_MAX 3
#define GSVC_VIDEO_FULL_RANGE_FLAG_MIN 0
#define GSVC_VIDEO_FULL_RANGE_FLAG_MAX 1
#define GSVC_CHROMA_SAMPLE_LOC_TYPE_MIN 0
#define GSVC_CHROMA_SAMPLE_LOC_TYPE_MAX 5
#define GSVC_CHOLESKY_BITS_MIN 1
#define GSVC_CHOLESKY_BITS_MAX 12
#define GSVC_COLOR_STAGES_MIN 1
#define GSVC_COLOR_STAGES_MAX 8
#define GSVC_COLOR_CODEWORDS_MIN 1
#define GSVC_COLOR_CODEWORDS_MAX 1024
#define GSVC_ENTROPY_PRECISION_MIN 12
#define GSVC_ENTROPY_PRECISION_MAX 16
#define GSVC_LANE_COUNT_MIN 1
#define GSVC_LANE_COUNT_MAX 64
#define GSVC_SURVIVOR_MAP_MIN 0
#define GSVC_SURVIVOR_MAP_MAX 1
#define GSVC_BLOCK_RESERVED_MIN 0
#define GSVC_BLOCK_RESERVED_MAX 0
#define GSVC_PLANE_MODE_MIN 0
#define GSVC_PLANE_MODE_MAX 2
#define GSVC_LANE_STATE_MIN 0x10000u
#define GSVC_LANE_STATE_MAX 0xFFFFFFFFu
#define GSVC_MAX_LANE_EXPONENT_MIN 0
#define GSVC_MAX_LANE_EXPONENT_MAX 12
#define GSVC_LAYER_COUNT_MIN 1
#define GSVC_LAYER_COUNT_MAX 4
#define GSVC_QUALITY_LEVEL_MIN 1
#define GSVC_QUALITY_LEVEL_MAX 5
#define GSVC_QUALITY_HALVINGS_MIN 0
#define GSVC_QUALITY_HALVINGS_MAX 3
#define GSVC_LANE_EXPONENT_MIN 0
#define GSVC_LANE_EXPONENT_MAX 12
#define GSVC_MOTION_CELL_MIN 0
#define GSVC_MOTION_CELL_MAX 3
#define GSVC_QUANTIZER_PRESENT_FRAME_BODY_MIN 0
#define GSVC_QUANTIZER_PRESENT_FRAME_BODY_MAX 1
#define GSVC_NEW_PRESENT_MIN 0
#define GSVC_NEW_PRESENT_MAX 1
#define GSVC_QUANTIZER_MIN 0
#define GSVC_QUANTIZER_MAX 79
#define GSVC_WORD_COUNT_RUN_MIN 0
#define GSVC_WORD_COUNT_RUN_MAX 0xFFFFFFFFu
#define GSVC_DENSITY_FAMILY_MIN 0
#define GSVC_DENSITY_FAMILY_MAX 1
#define GSVC_SCALE_CODE_MIN 0
#define GSVC_SCALE_CODE_MAX 31
#define GSVC_CENTRE_MIN 0
#define GSVC_CENTRE_MAX 1023
#define GSVC_SLOPE_MIN 0
#define GSVC_SLOPE_MAX 255
#define GSVC_HALVING_CODE_MIN 0
#define GSVC_HALVING_CODE_MAX 7
#define GSVC_LAYER_MIN 1
#define GSVC_LAYER_MAX 3
#define GSVC_LAYER_TYPE_MIN 0
#define GSVC_LAYER_TYPE_MAX 2

/* Values with a name. */
#define GSVC_FLAGS_PARAMETER_CHECKSUM_FLAG (1u << 0)
#define GSVC_FLAGS_PACED_FLAG (1u << 1)
#define GSVC_CHROMA_FORMAT_RGB 0
#define GSVC_CHROMA_FORMAT_420 1
#define GSVC_CHROMA_FORMAT_422 2
#define GSVC_CHROMA_FORMAT_444 3
#define GSVC_PLANE_MODE_CONSTANT 0
#define GSVC_PLANE_MODE_RAW 1
#define GSVC_PLANE_MODE_CODED 2
#define GSVC_DENSITY_FAMILY_LOGISTIC 0
#define GSVC_DENSITY_FAMILY_LAPLACE 1
#define GSVC_LAYER_TYPE_I 0
#define GSVC_LAYER_TYPE_P 1
#define GSVC_LAYER_TYPE_R 2

/* Limits of levels. */
#define GSVC_LEVEL_1_PIXELS 0x20000u
#define GSVC_LEVEL_1_SPLATS_FRAME 16384
#define GSVC_LEVEL_1_RENDERING_WORK_FRAME 0x2000000u
#define GSVC_LEVEL_1_BYTES_CHUNK_PAYLOAD 0x100000u
#define GSVC_LEVEL_1_PIXELS_SECOND 0x800000u
#define GSVC_LEVEL_1_SPLATS_SECOND 0x100000u
#define GSVC_LEVEL_1_RENDERING_WORK_SECOND 0x10000000u
#define GSVC_LEVEL_1_BYTES_SECOND 0x100000u
#define GSVC_LEVEL_2_PIXELS 0x100000u
#define GSVC_LEVEL_2_SPLATS_FRAME 0x10000u
#define GSVC_LEVEL_2_RENDERING_WORK_FRAME 0x10000000u
#define GSVC_LEVEL_2_BYTES_CHUNK_PAYLOAD 0x400000u
#define GSVC_LEVEL_2_PIXELS_SECOND 0x4000000u
#define GSVC_LEVEL_2_SPLATS_SECOND 0x400000u
#define GSVC_LEVEL_2_RENDERING_WORK_SECOND 0x80000000u
#define GSVC_LEVEL_2_BYTES_SECOND 0x400000u
#define GSVC_LEVEL_3_PIXELS 0x400000u
#define GSVC_LEVEL_3_SPLATS_FRAME 0x40000u
#define GSVC_LEVEL_3_RENDERING_WORK_FRAME 0x40000000u
#define GSVC_LEVEL_3_BYTES_CHUNK_PAYLOAD 0x1000000u
#define GSVC_LEVEL_3_PIXELS_SECOND 0x10000000u
#define GSVC_LEVEL_3_SPLATS_SECOND 0x1000000u
#define GSVC_LEVEL_3_RENDERING_WORK_SECOND 0x200000000ULL
#define GSVC_LEVEL_3_BYTES_SECOND 0x1000000u
#define GSVC_LEVEL_4_PIXELS 0x1000000u
#define GSVC_LEVEL_4_SPLATS_FRAME 0x100000u
#define GSVC_LEVEL_4_RENDERING_WORK_FRAME 0x100000000ULL
#define GSVC_LEVEL_4_BYTES_CHUNK_PAYLOAD 0x4000000u
#define GSVC_LEVEL_4_PIXELS_SECOND 0x40000000u
#define GSVC_LEVEL_4_SPLATS_SECOND 0x4000000u
#define GSVC_LEVEL_4_RENDERING_WORK_SECOND 0x800000000ULL
#define GSVC_LEVEL_4_BYTES_SECOND 0x4000000u
#define GSVC_LEVEL_5_PIXELS 0x4000000u
#define GSVC_LEVEL_5_SPLATS_FRAME 0x400000u
#define GSVC_LEVEL_5_RENDERING_WORK_FRAME 0x400000000ULL
#define GSVC_LEVEL_5_BYTES_CHUNK_PAYLOAD 0x10000000u
#define GSVC_LEVEL_5_PIXELS_SECOND 0x100000000ULL
#define GSVC_LEVEL_5_SPLATS_SECOND 0x10000000u
#define GSVC_LEVEL_5_RENDERING_WORK_SECOND 0x2000000000ULL
#define GSVC_LEVEL_5_BYTES_SECOND 0x10000000u

/* Constants of Annex A. */
#define GSVC_LONGEST_HEADER 1024 /* maximum size of a sequence header's payload in bytes */
#define GSVC_I_FRAME_SECONDS 4 /* seconds from an I-frame of a paced stream to the next one */
#define GSVC_SUPPORT_RADIUS 0x1.aa1e147bb26eap+1 /* ρ = √(2 ln 255), radius of the support */
#define GSVC_REACH 0x1.aa1ee98abcac8p+1 /* ρ′ = ρ (1 + 2⁻¹⁷) */
#define GSVC_MAIN_REACH 54544 /* ⌈2¹⁴ ρ′⌉, the radius of the boxes of profile main in 2⁻¹⁴ */
#define GSVC_SMALLEST_NORMAL 0x1p-126 /* 2⁻¹²⁶, smallest positive normal binary32; l11 or l22 below it is degenerate */
#define GSVC_VERSION_MAJOR 130 /* 128 + 2, draft 2 of version 1.0 */
#define GSVC_REFLECTED_POLYNOMIAL 0x82F63B78u /* CRC-32C, bits of 1EDC6F41 reversed */
#define GSVC_LOWEST_STATE 0x10000u /* 2¹⁶, where a lane of an encoder begins */
#define GSVC_LN_255 0x1.62a40fda3e3ccp+2 /* ln 255, largest σ of a pixel that a splat covers */
#define GSVC_SUPPORT_SQUARED 0x1.62a41p+3 /* K = 2 ln 255 rounded to binary32 */
#define GSVC_K1 (-0x1.ffffc8p-5) /* coefficient of exp(−m/16) */
#define GSVC_K2 0x1.fff2fp-10 /* coefficient of exp(−m/16) */
#define GSVC_K3 (-0x1.547a8p-15) /* coefficient of exp(−m/16) */
#define GSVC_K4 0x1.498f3ep-21 /* coefficient of exp(−m/16) */
#define GSVC_K5 (-0x1.908c68p-28) /* coefficient of exp(−m/16) */
#define GSVC_HALF 0x1p-1 /* pixel centre */
#define GSVC_ONE 0x1p+0 /* one */
#define GSVC_REVIVED_COUNT 0x1p+0 /* count of a codeword that was replaced */
#define GSVC_SETTLING 0x1.999999999999ap-1 /* part of the iterations up to the last removal */
#define GSVC_NEW_WEIGHT 0x1.47ae14p-7 /* w of a random splat */
#define GSVC_WINDOW_SIZE 11 /* taps of the window of MS-SSIM */
#define GSVC_WINDOW_DEVIATION 0x1.8p+0 /* its standard deviation */
#define GSVC_LUMINANCE_K 0x1.47ae147ae147bp-7 /* of C1 in (11-6) */
#define GSVC_STRUCTURE_K 0x1.eb851eb851eb8p-6 /* of C2 in (11-6) */
#define GSVC_MAIN 1 /* profile main as a value of profile */
#define GSVC_X_MOST 0x1000000u /* 2²⁴, largest magnitude of X and Y */
#define GSVC_A_LEAST (-3072) /* least A and B */
#define GSVC_A_MOST 13311 /* largest A and B */
#define GSVC_S_MOST 32767 /* largest magnitude of S */
#define GSVC_N_MOST 0x10000000u /* 2²⁸, largest magnitude of n0, n1 and n2 */
#define GSVC_CLASS_MOST 10 /* largest class j */
#define GSVC_PRECISION 14 /* R of profile main */
#define GSVC_TOTAL 16384 /* 2¹⁴, sum of the frequencies of a symbol */
#define GSVC_GROUP_LANES 32 /* lanes of a group */
#define GSVC_MAGNITUDE_CLASSES 40 /* classes of magnitudes of colour codes */
#define GSVC_REMOVED 8 /* the mode that removes a splat */
#define GSVC_STEP_MOST 0x1FFFFu /* 2¹⁷ − 1, largest step of a position */

#endif
