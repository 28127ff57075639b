/* What the headers of a newer glibc make of C++, for a module linked against glibc 2.28 (scripts/manylinux.sh). */
#include <stdlib.h>

/* Of 2.32: whether the process has one thread alone. It is not known, so counters stay atomic. */
char __libc_single_threaded = 0;

/* Of 2.38: numbers that may be binary, as of C23. */
long __isoc23_strtol(const char* text, char** end, int base) {
  return strtol(text, end, base);
}
long long __isoc23_strtoll(const char* text, char** end, int base) {
  return strtoll(text, end, base);
}
unsigned long __isoc23_strtoul(const char* text, char** end, int base) {
  return strtoul(text, end, base);
}
unsigned long long __isoc23_strtoull(const char* text, char** end, int base) {
  return strtoull(text, end, base);
}
