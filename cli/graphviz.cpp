#include "cli/graphviz.hpp"

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <sstream>

#include "cli/output.hpp"
#include "stiction/error.hpp"

extern char** environ;

namespace stiction::cli {

namespace fs = std::filesystem;

namespace {

using Layouts = std::array<const char*, 3>;

/// Layout programs, best first: fdp draws the boxes of clusters, sfdp unfolds stacks and walls, dot is always there.
constexpr Layouts kClusterLayouts{"fdp", "sfdp", "dot"};
constexpr Layouts kMeshLayouts{"sfdp", "fdp", "dot"};

/// The first of `layouts` in PATH, or an empty path.
fs::path find_layout(const Layouts& layouts) {
  const char* variable = std::getenv("PATH");
  for (const char* program : layouts) {
    std::istringstream folders(variable == nullptr ? "" : variable);
    for (std::string folder; std::getline(folders, folder, ':');) {
      const fs::path candidate = fs::path(folder.empty() ? "." : folder) / program;
      if (access(candidate.c_str(), X_OK) == 0) return candidate;
    }
  }
  return {};
}

bool wants_svg(const fs::path& path) {
  return path.extension() == ".svg";
}

/// Runs `program -Tsvg -o output input` without a shell; its exit status, -1 if it could not be run.
int draw(const fs::path& program, const fs::path& input, const fs::path& output) {
  std::array<std::string, 5> words{program.string(), "-Tsvg", "-o", output.string(), input.string()};
  std::array<char*, 6> argv{};
  for (std::size_t i = 0; i < words.size(); ++i) argv[i] = words[i].data();
  pid_t child = 0;
  if (posix_spawn(&child, program.c_str(), nullptr, nullptr, argv.data(), environ) != 0) return -1;
  int status = 0;
  if (waitpid(child, &status, 0) != child || !WIFEXITED(status)) return -1;
  return WEXITSTATUS(status);
}

/// The DOT text in a separate file for as long as Graphviz reads it.
class TemporaryDot {
 public:
  explicit TemporaryDot(const std::string& dot)
      : path_(fs::temp_directory_path() / fmt::format("stiction-{}.dot", getpid())) {
    write_text(path_, dot);
  }
  ~TemporaryDot() {
    std::error_code ignored;
    fs::remove(path_, ignored);
  }
  TemporaryDot(const TemporaryDot&) = delete;
  TemporaryDot& operator=(const TemporaryDot&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

}  // namespace

void require_graph_path(const fs::path& path) {
  const fs::path extension = path.extension();
  if (extension != ".svg" && extension != ".dot" && extension != ".gv") {
    throw Error(ErrorCode::invalid_argument,
                fmt::format("--graph {}: expected a name ending in .svg or .dot", path.string()));
  }
  if (wants_svg(path) && find_layout(kMeshLayouts).empty()) {
    throw Error(ErrorCode::unsupported,
                fmt::format("--graph {}: Graphviz is not installed (Debian: graphviz); install it or write a .dot file",
                            path.string()));
  }
  require_writable(path);
}

void write_graph(const fs::path& path, const std::string& dot, bool clusters) {
  if (!wants_svg(path)) {
    write_text(path, dot);
    return;
  }
  const fs::path program = find_layout(clusters ? kClusterLayouts : kMeshLayouts);
  const TemporaryDot input(dot);
  const int status = draw(program, input.path(), path);
  if (status != 0) {
    throw Error(ErrorCode::io, fmt::format("{}: {} failed with exit status {}; write a .dot file instead",
                                           path.string(), program.string(), status));
  }
}

}  // namespace stiction::cli
