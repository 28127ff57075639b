#pragma once

#include "core/algorithm/collision/integrate.hpp"
#include "cuda/api/kernel.hpp"

namespace stiction::cuda {

/// Arguments of finding contacts beside the job.
template <class Real>
struct WorldFindArgs {
  WorldJob<Real> job;
  Offset env_count;
  std::byte* workspace;  ///< ListedPairs of each team that runs                                              (teams *
                         ///< workspace_bytes)
  Offset workspace_bytes;
  FoundContact<Real>* found;  ///< contacts of each environment that has no more than `most`        (env_count * most)
  Index most;
  Index* count;  ///< contacts of each environment, listed or not                                   (env_count)
};

/// Arguments of finding contacts where a tree finds near pairs.
template <class Real>
struct WorldFindNearArgs {
  WorldFindArgs<Real> find;  ///< `workspace` has a NearWorkspace and room for near pairs for each team
  Offset room;               ///< limit of near pairs
  Offset* near;              ///< near pairs of each environment                                      (env_count)
};

/// Arguments of handing them to the solver.
template <class Real>
struct EmitWorldContactsArgs {
  WorldModelView<Real> model;
  ContactSink<Real> sink;
  Offset env_count;
  const FoundContact<Real>* found;
  Index most;
};

template <class Real>
struct WorldArgs {
  WorldJob<Real> job;
  Offset env_count;
  WorldMotion* motion;  ///< where it is asked for                                                  (env_count)
};

}  // namespace stiction::cuda

/// The stages of a world's step around its solve on a device; a team takes an environment at a time.
namespace stiction::inline STICTION_ISA {

template <class Real>
struct FindWorldContacts {
  using Args = cuda::WorldFindArgs<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const ListedPairs<Real> pairs(args.job.model, args.workspace + id.index * args.workspace_bytes);
    for (Offset env = id.index; env < args.env_count; env += id.count) {
      prepare_world(team, args.job, env);
      const Index count = find_contacts(team, args.job, env, pairs);
      if (count <= args.most) list_contacts(team, args.job, env, pairs, args.found + env * args.most);
      single(team, [&] { args.count[env] = count; });
    }
  }
};

/// An environment with more near pairs than fit has no contacts, and records how many pairs it has.
template <class Real>
struct FindNearWorldContacts {
  using Args = cuda::WorldFindNearArgs<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& all) {
    const cuda::WorldFindArgs<Real>& args = all.find;
    std::byte* const memory = args.workspace + id.index * args.workspace_bytes;
    NearWorkspace<Real> workspace(args.job.model, memory);
    std::byte* const pairs = memory + NearWorkspace<Real>::bytes(args.job.model);
    for (Offset env = id.index; env < args.env_count; env += id.count) {
      prepare_world(team, args.job, env);
      const Offset near = count_near_pairs(team, args.job, env, workspace);
      Index count = 0;
      if (near <= all.room) {
        count = find_near_contacts(team, args.job, env, workspace, static_cast<Index>(near), pairs);
        const NearPairs<Real> found(args.job.model, workspace, static_cast<Index>(near), pairs);
        if (count <= args.most) list_contacts(team, args.job, env, found, args.found + env * args.most);
      }
      single(team, [&] {
        args.count[env] = count;
        all.near[env] = near;
      });
    }
  }
};

template <class Real>
struct EmitWorldContacts {
  using Args = cuda::EmitWorldContactsArgs<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    for (Offset env = id.index; env < args.env_count; env += id.count)
      emit_contacts(team, args.model, args.sink, env, args.found + env * args.most);
  }
};

template <class Real>
struct IntegrateWorlds {
  using Args = cuda::WorldArgs<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    for (Offset env = id.index; env < args.env_count; env += id.count) integrate_world(team, args.job, env);
  }
};

/// Energy and momentum; a lane takes an environment, since its bodies are added in their order.
template <class Real>
struct MeasureWorlds {
  using Args = cuda::WorldArgs<Real>;
  static constexpr bool kSerial = true;

  template <Team TeamT>
  static STICTION_HD void run(TeamT&, const cuda::TeamId& id, const Args& args) {
    for (Offset env = id.index; env < args.env_count; env += id.count) args.motion[env] = motion_of(args.job, env);
  }
};

}  // namespace stiction::inline STICTION_ISA
