#pragma once

#include "core/job/world_job.hpp"

namespace stiction::cpu {

/// The stages of a world's step on one environment, compiled for one instruction set.
template <class Real>
struct WorldKernels {
  Offset (*workspace_bytes)(const WorldModelView<Real>& model);  ///< scratch of each environment
  Offset (*pair_bytes)(Offset pairs);                            ///< scratch of near pairs, where a tree finds them
  /// Near pairs of an environment with a tree.
  Offset (*count_near)(const WorldJob<Real>& job, Offset env, void* workspace);
  /// Contacts; of that many near pairs where there is a tree.
  Index (*find_contacts)(const WorldJob<Real>& job, Offset env, void* workspace, Index near, void* pairs);
  void (*list_contacts)(const WorldJob<Real>& job, Offset env, void* workspace, Index near, void* pairs,
                        FoundContact<Real>* out);
  void (*emit_contacts)(const WorldJob<Real>& job, const ContactSink<Real>& sink, Offset env,
                        const FoundContact<Real>* found);
  void (*integrate)(const WorldJob<Real>& job, Offset env);
  WorldMotion (*motion)(const WorldJob<Real>& job, Offset env);
};

/// Kernels of both precisions.
struct WorldKernelSet {
  WorldKernels<float> f32;
  WorldKernels<double> f64;
};

}  // namespace stiction::cpu
