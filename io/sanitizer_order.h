// Orders that the thread sanitizer does not see, told to it: the kernel's (io/uring_reader), and those of libraries that it
// was not built into (engine/run_on_threads: the packaged oneTBB; scripts/instrumented_tbb makes another). What comes
// before tell_sanitizer_before(place) on one thread comes before what comes after tell_sanitizer_after(place) on another.
// Any number of threads. Cost: nothing without that sanitizer, for there they are empty.
#pragma once

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
#endif

namespace shoal {

#if defined(__SANITIZE_THREAD__)
inline void tell_sanitizer_before(const void* place) { __tsan_release(const_cast<void*>(place)); }
inline void tell_sanitizer_after(const void* place) { __tsan_acquire(const_cast<void*>(place)); }
#else
inline void tell_sanitizer_before(const void* /*place*/) {}
inline void tell_sanitizer_after(const void* /*place*/) {}
#endif

}  // namespace shoal
