#pragma once

#include <stdio.h>
#include <string.h>

#include "stiction.h"

static int failures = 0;

/* Prints the condition that did not hold, and goes on. */
#define STICTION_CHECK(condition)                                       \
  do {                                                                  \
    if (!(condition)) {                                                 \
      fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition);   \
      fprintf(stderr, "  last error: \"%s\"\n", stiction_last_error()); \
      ++failures;                                                       \
    }                                                                   \
  } while (0)

/* A call that must succeed. */
#define STICTION_CHECK_OK(call) STICTION_CHECK((call) == STICTION_OK)

/* A call that must fail with that code and a text that has both pieces in it. */
#define STICTION_CHECK_FAILS(call, code, piece, other)                                            \
  do {                                                                                            \
    STICTION_CHECK((call) == (code));                                                             \
    STICTION_CHECK(strstr(stiction_last_error(), piece) && strstr(stiction_last_error(), other)); \
  } while (0)
