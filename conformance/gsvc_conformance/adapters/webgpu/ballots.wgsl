// Lanes of an entropy coder that run side by side in one workgroup, and share one list of words.
//
// This text is put in front of the shaders that need it.

const MAX_LANES = 64u;
const LOWEST_STATE = 0x10000u;

// Which lanes move a word in a round. The words of all lanes form one list in the order of symbols, and so,
// within a round, in that of lanes: a lane finds its word by counting the lanes before it that move one, too. (With
// the feature "subgroups" and all lanes in one subgroup, subgroupBallot does this without workgroup memory.)

// Three ballots in turn make one barrier a round enough: while one is voted on, a slow lane may still read the one
// before, and the third is cleared.
var<workgroup> ballots: array<array<atomic<u32>, 2>, 3>;

fn clear_ballots(lane: u32) {
    // WebGPU promises zeros, but not every implementation keeps that: wgpu-py 0.32 on Mesa's lavapipe did not.
    if (lane < 6u) {
        atomicStore(&ballots[lane / 2u][lane % 2u], 0u);
    }
    workgroupBarrier();
}

// A bit for each lane. All lanes have to come here, in every round.
fn ballot(round: u32, lane: u32, vote: bool) -> vec2<u32> {
    if (vote) {
        atomicOr(&ballots[round % 3u][lane / 32u], 1u << (lane % 32u));
    }
    workgroupBarrier();
    let votes = vec2<u32>(atomicLoad(&ballots[round % 3u][0]), atomicLoad(&ballots[round % 3u][1]));
    if (lane < 2u) {
        atomicStore(&ballots[(round + 2u) % 3u][lane], 0u);
    }
    return votes;
}

fn all_votes(votes: vec2<u32>) -> u32 {
    return countOneBits(votes.x) + countOneBits(votes.y);
}

fn votes_before(votes: vec2<u32>, lane: u32) -> u32 {
    let lower_lanes = (1u << (lane % 32u)) - 1u;    // of its half of the 64
    if (lane < 32u) {
        return countOneBits(votes.x & lower_lanes);
    }
    return countOneBits(votes.x) + countOneBits(votes.y & lower_lanes);
}
