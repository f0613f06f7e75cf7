// Whether a sanitizer watches this build: it holds freed memory and shadows of all memory, so that what is resident says
// nothing of the program, and takes its time.
#pragma once

namespace shoal::testing {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

}  // namespace shoal::testing
