/* Symbols that Debian 12's glibc headers make of C++, for a module linked against glibc 2.28 (scripts/manylinux.sh). */

/* Since 2.32: true if the process has one thread alone. It is not known, so counters stay atomic. */
char __libc_single_threaded = 0;
