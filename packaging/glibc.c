/* What the headers of Debian 12's glibc make of C++, for a module linked against glibc 2.28 (scripts/manylinux.sh). */

/* Of 2.32: whether the process has one thread alone. It is not known, so counters stay atomic. */
char __libc_single_threaded = 0;
