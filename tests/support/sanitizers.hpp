#pragma once

/// What a test may ask about the build it is in.
namespace stiction::test {

/// Whether the thread sanitizer watches. It makes a solve some twenty times slower, and sees two accesses without an
/// order in the first iteration as well as in the fortieth. So tests of threads iterate and repeat less then, on the
/// same solvers and batches.
#if defined(__SANITIZE_THREAD__)
inline constexpr bool kThreadSanitizer = true;
#else
inline constexpr bool kThreadSanitizer = false;
#endif

/// Whether a sanitizer of any kind watches. What whole devices and many threads do to memory shows in the first
/// iteration, too. What later iterations do is watched in tests of one team.
#if defined(__SANITIZE_ADDRESS__)
inline constexpr bool kSanitizer = true;
#else
inline constexpr bool kSanitizer = kThreadSanitizer;
#endif

}  // namespace stiction::test
