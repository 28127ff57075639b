#pragma once

/// Facts about a test's build.
namespace stiction::test {

/// True if the thread sanitizer watches. It makes a solve some twenty times slower, and sees two accesses without an
/// order in the first iteration as well as in the fortieth. Tests of threads hence iterate and repeat less then, on
/// the same solvers and batches.
#if defined(__SANITIZE_THREAD__)
inline constexpr bool kThreadSanitizer = true;
#else
inline constexpr bool kThreadSanitizer = false;
#endif

/// True if a sanitizer of any kind watches. Errors of whole devices and many threads in memory show in the first
/// iteration, too. Later iterations are watched in tests of one team.
#if defined(__SANITIZE_ADDRESS__)
inline constexpr bool kSanitizer = true;
#else
inline constexpr bool kSanitizer = kThreadSanitizer;
#endif

}  // namespace stiction::test
