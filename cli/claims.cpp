#include "cli/claims.hpp"

#include <vector>

#include "stiction/residual.hpp"

namespace stiction::cli {

void judge_by_file(const ContactBatch<double>& file_batch, const SolverOptions& options, Solution<float>& solution) {
  const std::vector<double> lambda(solution.lambda.begin(), solution.lambda.end());
  const std::vector<Residual> judged = verify(file_batch.view(), std::span<const double>(lambda));
  for (std::size_t env = 0; env < judged.size(); ++env) {
    EnvStatus& status = solution.status[env];
    if (status.code != EnvCode::solved || judged[env].relative <= options.tolerance ||
        judged[env].absolute <= options.absolute_tolerance)
      continue;
    status.code = EnvCode::rounding;
    status.residual = judged[env].relative;
    status.residual_absolute = judged[env].absolute;
  }
}

}  // namespace stiction::cli
