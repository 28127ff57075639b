#include <pthread.h>

#include "check.h"

/* Each thread fails in its own way, many times over, and must read its own text. */
static void* fail_often(void* device) {
  stiction_solver* solver = NULL;
  int i, wrong = strcmp(stiction_last_error(), "") != 0;
  for (i = 0; i < 2000; ++i) {
    wrong += stiction_solver_create(device, NULL, NULL, &solver) != STICTION_INVALID_ARGUMENT;
    wrong += strstr(stiction_last_error(), device) == NULL;
  }
  return wrong == 0 ? NULL : device;
}

int main(void) {
  static char first[] = "abacus", second[] = "slide rule";
  pthread_t one, other;
  void *one_wrong = first, *other_wrong = second;
  STICTION_CHECK(pthread_create(&one, NULL, fail_often, first) == 0);
  STICTION_CHECK(pthread_create(&other, NULL, fail_often, second) == 0);
  pthread_join(one, &one_wrong);
  pthread_join(other, &other_wrong);
  STICTION_CHECK(one_wrong == NULL && other_wrong == NULL);
  STICTION_CHECK(strcmp(stiction_last_error(), "") == 0);
  return failures != 0;
}
