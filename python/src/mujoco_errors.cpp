#include "python/src/mujoco_errors.hpp"

#include <csetjmp>
#include <cstring>
#include <string>

#include "stiction/error.hpp"

namespace stiction::python {

namespace {

/// The beginning of an mjLogMessage, which the Python side compares with MuJoCo's description of itself.
struct Message {
  int level, topic;
  char subject[1024];
};
constexpr int kError = 3;  ///< mjLOG_ERROR

/// State of this thread, while it is in a function of MuJoCo's.
struct Call {
  std::jmp_buf* back = nullptr;
  MujocoHandler others = nullptr;  ///< takes messages that are no error
  char subject[sizeof(Message::subject)] = {};
};
thread_local Call now;

void take(const void* message) {
  const auto& said = *static_cast<const Message*>(message);
  if (said.level != kError || now.back == nullptr) {
    if (now.others != nullptr) now.others(message);
    return;
  }
  std::memcpy(now.subject, said.subject, sizeof(now.subject) - 1);
  std::longjmp(*now.back, 1);  // an exception would have to pass through C
}

}  // namespace

MujocoErrors::MujocoErrors(const MujocoHandlers& handlers) : handlers_(handlers) {
  if (handlers_.set_of_thread == nullptr) return;
  now.others = handlers_.of_all();
  kept_ = handlers_.set_of_thread(take);
}

MujocoErrors::~MujocoErrors() {
  if (handlers_.set_of_thread != nullptr) handlers_.set_of_thread(kept_);
}

void MujocoErrors::call(void (*function)(const void* model, void* data), const void* model, void* data,
                        std::size_t simulation) const {
  if (handlers_.set_of_thread == nullptr) return function(model, data);
  std::jmp_buf here;
  now.back = &here;
  if (setjmp(here) == 0) {
    function(model, data);
    now.back = nullptr;
    return;
  }
  now.back = nullptr;
  throw Error(ErrorCode::unsupported, "simulation " + std::to_string(simulation) + ": MuJoCo: " + now.subject +
                                          "; reset() it, or replace its data, before another step");
}

}  // namespace stiction::python
