#include <string>

#include "c_api/judge.hpp"
#include "c_api/structs.hpp"
#include "c_api/views.hpp"
#include "stiction/config.hpp"
#include "stiction/io.hpp"

namespace stiction::c {

namespace {

/// The answer without the room that the batch leaves between environments.
template <class Real>
io::SolutionFile packed(const ContactBatchView<Real>& batch, const SolutionView<Real>& solution) {
  io::SolutionFile file;
  file.precision = sizeof(Real) == sizeof(double) ? Precision::f64 : Precision::f32;
  file.env_row_offsets = {0};
  for (Offset env = 0; env < batch.env_count; ++env) {
    const Offset first = batch.env_row_offsets[env], rows = batch.env_rows(env);
    for (Offset row = first; row < first + rows; ++row) {
      file.lambda.push_back(static_cast<double>(solution.lambda[row]));
      if (solution.w != nullptr) file.w.push_back(static_cast<double>(solution.w[row]));
    }
    file.env_row_offsets.push_back(static_cast<Offset>(file.lambda.size()));
    if (solution.status != nullptr) file.status.push_back(solution.status[env]);
  }
  return file;
}

}  // namespace

}  // namespace stiction::c

namespace c = stiction::c;

stiction_code stiction_solution_write(const char* path, const stiction_batch_view* batch,
                                      const stiction_solution* solution, const stiction_solver_options* options,
                                      const char* source) {
  return c::guarded([&] {
    c::need(path, "path", "give the file's name");
    const stiction_batch_view given = c::read_struct(batch, "batch");
    const stiction_solution answer = c::read_struct(solution, "solution");
    const auto solved = c::to_cpp(c::read_optional(options, "options"));
    stiction::io::SolutionFile file;
    c::with_real(c::precision_of("batch.precision", given.precision), [&](auto zero) {
      using Real = decltype(zero);
      const auto view = c::to_cpp<Real>(given);
      c::need_host(view.space);
      c::need_sound(view);
      if (view.row_count > 0) c::need(answer.lambda, "solution.lambda", "give the reactions that are to be written");
      file = c::packed(view, c::to_cpp<Real>(answer));
      file.law = solved.law.value_or(view.law);
    });
    file.solver = to_string(solved.solver);
    file.source = source != nullptr ? source : std::string("stiction ") + stiction::kVersion + ", C interface";
    stiction::io::write_solution(path, file);
  });
}
