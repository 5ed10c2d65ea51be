// Counts what the calling thread allocates: instead of the C library's functions, or told by the address sanitizer.
#include <stddef.h>

static __thread long count;

long allocations(void) { return count; }

#ifdef SANITIZED
extern int __sanitizer_install_malloc_and_free_hooks(
    void (*on_malloc)(const volatile void*, size_t), void (*on_free)(const volatile void*));

static void note(const volatile void* memory, size_t size) { count++; }
static void pass(const volatile void* memory) {}

__attribute__((constructor)) static void listen(void) { __sanitizer_install_malloc_and_free_hooks(note, pass); }
#else
extern void* __libc_malloc(size_t size);
extern void* __libc_calloc(size_t number, size_t size);
extern void* __libc_realloc(void* memory, size_t size);

void* malloc(size_t size) { count++; return __libc_malloc(size); }
void* calloc(size_t number, size_t size) { count++; return __libc_calloc(number, size); }
void* realloc(void* memory, size_t size) { count++; return __libc_realloc(memory, size); }
#endif
