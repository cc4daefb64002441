/* The sections MATERIAL and IMAGE: docs/format.md, "Attributes, groups, materials". */

#include "materials.h"

#define MATERIAL_NUMBERS 12
#define TEXTURE_NUMBERS 5
#define DOUBLE_SIDED 4U
#define UNLIT 8U
#define MAX_FLAGS 15U
#define LAST_ALPHA_MODE 2U
#define LAST_WRAP 4U
#define LAST_MAGNIFICATION 2U
#define LAST_MINIFICATION 6U
#define RGB 7U
#define RGBA 15U

/* Overwrite the defaults in `numbers`, of length `count`, with the numbers that the file stores. */
static int read_numbers(reel_call *call, reel_range *input, unsigned count, double *numbers) {
    uint64_t offset = input->offset, present;
    REEL_TRY(reel_read_varint(call, input, &present));
    REEL_CORRUPT_IF(present >> count, offset, "a material sets unknown numbers");
    for (unsigned i = 0; i < count; i++) {
        if (present >> i & 1U) {
            offset = input->offset;
            REEL_TRY(reel_read_bytes(call, input, &numbers[i], sizeof numbers[i]));
            REEL_CORRUPT_IF(!reel_is_finite(numbers[i]), offset,
                            "a number of a material is not finite");
        }
    }
    return MESHREEL_OK;
}

/* ---- textures ---- */

static bool is_valid_for_slot(unsigned slot, uint8_t channels) {
    bool is_color = slot == MESHREEL_BASE_COLOR || slot == MESHREEL_NORMAL ||
                    slot == MESHREEL_EMISSIVE;
    bool is_one = channels && !(channels & (channels - 1U));
    return is_color ? channels == RGB || channels == RGBA : is_one && channels < RGBA;
}

/* Read the channels, wrap modes and filters of a texture. */
static int read_sampling(reel_call *call, reel_range *input, unsigned slot,
                         meshreel_texture *result) {
    uint64_t offset = input->offset;
    uint8_t bytes[3];
    REEL_TRY(reel_read_bytes(call, input, bytes, sizeof bytes));
    REEL_CORRUPT_IF(!is_valid_for_slot(slot, bytes[0]), offset,
                    "a texture uses channels that its slot does not allow");
    result->channels = bytes[0];
    result->wrap_u = bytes[1] & 15U;
    result->wrap_v = bytes[1] >> 4;
    result->magnified = bytes[2] & 15U;
    result->shrunk = bytes[2] >> 4;
    REEL_CORRUPT_IF(result->wrap_u > LAST_WRAP || result->wrap_v > LAST_WRAP, offset + 1,
                    "the wrap mode of a texture is unknown");
    REEL_CORRUPT_IF(result->magnified > LAST_MAGNIFICATION || result->shrunk > LAST_MINIFICATION,
                    offset + 2, "the filter of a texture is unknown");
    return MESHREEL_OK;
}

static int read_texture(reel_call *call, reel_pool *pool, reel_range *input, uint32_t n_images,
                        unsigned slot, meshreel_texture *result) {
    uint64_t offset = input->offset, image;
    double numbers[TEXTURE_NUMBERS] = {0.0, 0.0, 0.0, 1.0, 1.0};
    REEL_TRY(reel_read_varint(call, input, &image));
    REEL_CORRUPT_IF(image >= n_images, offset, "a texture refers to an image that does not exist");
    REEL_TRY(reel_read_text(call, pool, input, &result->uv));
    REEL_TRY(read_sampling(call, input, slot, result));
    REEL_TRY(read_numbers(call, input, TEXTURE_NUMBERS, numbers));
    result->image = (uint32_t)image;
    reel_copy(result->offset, numbers, sizeof result->offset);
    result->rotation = numbers[2];
    reel_copy(result->scale, numbers + 3, sizeof result->scale);
    return MESHREEL_OK;
}

static int read_textures(reel_call *call, reel_pool *pool, reel_range *input, uint32_t n_images,
                         meshreel_material *result) {
    uint64_t offset = input->offset;
    uint8_t slots;
    REEL_TRY(reel_read_bytes(call, input, &slots, 1));
    REEL_CORRUPT_IF(slots >> MESHREEL_SLOTS, offset, "a material has textures in unknown slots");
    for (unsigned slot = 0; slot < MESHREEL_SLOTS; slot++) {
        meshreel_texture *texture = &result->textures[slot];
        *texture = (meshreel_texture){
            .image = MESHREEL_NONE, .uv = {.bytes = ""}, .scale = {1.0, 1.0}};
        if (slots >> slot & 1U) {
            REEL_TRY(read_texture(call, pool, input, n_images, slot, texture));
        }
    }
    return MESHREEL_OK;
}

/* ---- materials ---- */

static int read_flags(reel_call *call, reel_range *input, meshreel_material *result) {
    uint64_t offset = input->offset;
    uint8_t flags;
    REEL_TRY(reel_read_bytes(call, input, &flags, 1));
    result->alpha_mode = flags & 3U;
    result->is_double_sided = (flags & DOUBLE_SIDED) != 0;
    result->is_unlit = (flags & UNLIT) != 0;
    return flags <= MAX_FLAGS && result->alpha_mode <= LAST_ALPHA_MODE
               ? MESHREEL_OK
               : reel_corrupt(call, offset,
                              "the flags or the alpha mode of a material are unknown");
}

static int read_appearance(reel_call *call, reel_range *input, meshreel_material *result) {
    double numbers[MATERIAL_NUMBERS] = {1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.5};
    REEL_TRY(read_numbers(call, input, MATERIAL_NUMBERS, numbers));
    reel_copy(result->base_color, numbers, sizeof result->base_color);
    result->metallic = numbers[4];
    result->roughness = numbers[5];
    reel_copy(result->emissive, numbers + 6, sizeof result->emissive);
    result->normal_scale = numbers[9];
    result->occlusion_strength = numbers[10];
    result->alpha_cutoff = numbers[11];
    return MESHREEL_OK;
}

int reel_read_material(reel_call *call, reel_pool *pool, reel_range payload, uint32_t n_images,
                       meshreel_material *result) {
    reel_range input = payload;
    *result = (meshreel_material){0};
    REEL_TRY(reel_read_text(call, pool, &input, &result->name));
    REEL_TRY(read_flags(call, &input, result));
    REEL_TRY(read_appearance(call, &input, result));
    REEL_TRY(read_textures(call, pool, &input, n_images, result));
    return !input.length
               ? MESHREEL_OK
               : reel_corrupt(call, input.offset, "bytes follow the last part or texture");
}

/* ---- images ---- */

int reel_read_image(reel_call *call, reel_pool *pool, reel_range payload, meshreel_image *result) {
    reel_range input = payload;
    *result = (meshreel_image){0};
    REEL_TRY(reel_read_text(call, pool, &input, &result->name));
    REEL_TRY(reel_read_text(call, pool, &input, &result->media_type));
    result->offset = input.offset;
    result->size = input.length;
    return MESHREEL_OK;
}
