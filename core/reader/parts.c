/* Decodes many small segments in one call. */

#include "parts.h"

#include "file.h"

/* Decode all tracks block by block: some are predicted from the positions of the block. */
static void decode_blocks(reel_part *part, meshreel_decoder *decoder) {
    const meshreel_file *file = part->file;
    uint32_t n_frames = file->info.n_frames;
    int failed = MESHREEL_OK;
    if (part->first > n_frames || part->count > n_frames - part->first) {
        failed = reel_invalid(&part->error, "the frames do not exist");
    }
    for (uint32_t done = 0; done < part->count && !failed;) {
        uint32_t first = part->first + done;
        const reel_block_entry *block =
            &file->outline.blocks[meshreel_block_of_frame(file, first)];
        uint32_t count = block->first + block->n_frames - first;
        count = count < part->count - done ? count : part->count - done;
        for (uint32_t i = 0; i < file->info.n_tracks && !failed; i++) {
            const meshreel_track *track = &file->tracks[i].info;
            size_t frame_bytes = (size_t)track->n_items * track->n_columns * file->tracks[i].size;
            failed = meshreel_decode(decoder, i, first, count, i ? 0 : part->n_modes, NULL,
                                     (uint8_t *)part->values[i] + done * frame_bytes, &part->error);
        }
        done += count;
    }
}

static void decode_part(void *shared, uint32_t i) {
    reel_part *part = (reel_part *)shared + i;
    meshreel_file *file = part->file;
    meshreel_host host = file->host;
    meshreel_decoder *decoder = NULL;
    file->host.run = NULL; /* the thread works alone */
    part->error = (meshreel_error){.code = MESHREEL_OK};
    int failed = part->with_surface ? meshreel_read_surface(file, &part->error)
                                    : meshreel_read_mesh(file, &part->error);
    failed = failed ? failed : meshreel_begin(file, &decoder, &part->error);
    if (!failed) {
        decode_blocks(part, decoder);
    }
    meshreel_end(decoder);
    file->host = host;
}

void reel_decode_parts(reel_part *parts, uint32_t n_parts) {
    meshreel_host host = parts->file->host; /* `decode_part` changes that of the file */
    reel_call call = reel_begin_call(NULL, &host, 0);
    reel_run(&call, decode_part, parts, n_parts, UINT64_MAX);
}
