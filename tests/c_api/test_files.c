#include "check.h"
#include "two_blocks.h"

/* argv: a contact-batch file that is there, a place to write. */
int main(int count, char** arguments) {
  stiction_batch* batch = NULL;
  stiction_batch_view view, narrow, blocks, again;
  const uint64_t* cone_id = NULL;
  stiction_code code;
  if (count != 3) return 2;
  STICTION_CHECK_OK(stiction_batch_view_init(&view, sizeof view));
  STICTION_CHECK_OK(stiction_batch_view_init(&narrow, sizeof narrow));
  STICTION_CHECK_OK(stiction_batch_view_init(&again, sizeof again));
  code = stiction_batch_read(arguments[1], &batch);
  if (code == STICTION_UNSUPPORTED) {
    STICTION_CHECK(strstr(stiction_last_error(), "HDF5") != NULL);
    printf("skipped: %s\n", stiction_last_error());
    return failures != 0 ? 1 : 77;
  }
  STICTION_CHECK(code == STICTION_OK);
  STICTION_CHECK_OK(stiction_batch_get_view(batch, STICTION_F64, &view));
  STICTION_CHECK_OK(stiction_batch_get_view(batch, STICTION_F32, &narrow));
  STICTION_CHECK(view.precision == STICTION_F64 && narrow.precision == STICTION_F32 && view.env_count > 0);
  STICTION_CHECK(narrow.row_count == view.row_count && view.row_count > 0);
  if (failures == 0) STICTION_CHECK(((const float*)narrow.b)[0] == (float)((const double*)view.b)[0]);
  STICTION_CHECK_OK(stiction_batch_get_cone_ids(batch, &cone_id));
  STICTION_CHECK_OK(stiction_validate(&view, STICTION_SOLVER_NPGS));
  STICTION_CHECK_OK(stiction_batch_destroy(batch));
  STICTION_CHECK_FAILS(stiction_batch_get_view(batch, STICTION_F64, &view), STICTION_INVALID_ARGUMENT,
                       "no live stiction_batch", "destroyed");

  two_blocks(&blocks, STICTION_F32);
  STICTION_CHECK_OK(stiction_batch_write(arguments[2], &blocks, "two blocks"));
  STICTION_CHECK_OK(stiction_batch_read(arguments[2], &batch));
  STICTION_CHECK_OK(stiction_batch_get_view(batch, STICTION_F32, &again));
  STICTION_CHECK(again.env_count == 2 && again.row_count == 6 && again.law == STICTION_LAW_COULOMB);
  if (failures == 0) {
    STICTION_CHECK(memcmp(again.b, kFloatB, sizeof kFloatB) == 0 && memcmp(again.mu, kFloatMu, sizeof kFloatMu) == 0);
    STICTION_CHECK(memcmp(again.A, kFloatA, sizeof kFloatA) == 0 &&
                   memcmp(again.cone_kind, kKinds, sizeof kKinds) == 0);
  }
  STICTION_CHECK_OK(stiction_batch_destroy(batch));

  STICTION_CHECK_FAILS(stiction_batch_write("no_such_folder/a.h5", &blocks, NULL), STICTION_IO, "no_such_folder", "");
  STICTION_CHECK_FAILS(stiction_batch_read("no_such_file.h5", &batch), STICTION_IO, "no_such_file.h5", "");
  return failures != 0;
}
