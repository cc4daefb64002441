/* The library's host in a web page. JavaScript allocates memory and fetches bytes. Reading a range
   that is not fetched yet fails as MESHREEL_UNREADABLE; the page then fetches it and calls
   again. */

#include "file.h"

#ifdef __wasm__

#define IMPORT(name) __attribute__((import_module("page"), import_name(name)))

/* Copy a range of the file; returns 0, or 1 if it is not fetched. */
IMPORT("read") extern int page_read(double offset, void *to, size_t size);

/* Return 0 if a range of the file is fetched, else 1. */
IMPORT("announce") extern int page_announce(double offset, double size);

IMPORT("allocate") extern void *page_allocate(size_t size);
IMPORT("release") extern void page_release(void *memory, size_t size);

static int read(void *user, uint64_t offset, void *to, size_t size) {
    (void)user;
    return page_read((double)offset, to, size);
}

static int announce(void *user, uint64_t offset, uint64_t size) {
    (void)user;
    return page_announce((double)offset, (double)size);
}

static void *allocate(void *user, size_t size) {
    (void)user;
    return page_allocate(size);
}

static void release(void *user, void *memory, size_t size) {
    (void)user;
    page_release(memory, size);
}

/* Open the page's file. */
int page_open(double size, double memory_limit, meshreel_file **file, meshreel_error *error) {
    meshreel_source source = {.size = (uint64_t)size, .read = read, .announce = announce};
    meshreel_host host = {.allocate = allocate, .release = release,
                          .memory_limit = (uint64_t)memory_limit};
    return meshreel_open(&source, &host, file, error);
}

/* Verify the checksum of an image; `number` must be valid. */
int page_check_image(const meshreel_file *file, uint32_t number, meshreel_error *error) {
    reel_call call = reel_begin_file_call(file, 0);
    const reel_section *section = file->outline.leading;
    for (; section->id != REEL_IMAGE || number; section++) {
        number -= section->id == REEL_IMAGE;
    }
    int failed =
        reel_announce(&call, (reel_range){section->offset, section->end - section->offset});
    return reel_end_call(&call, failed ? failed : reel_section_check(&call, section), error);
}

#endif
