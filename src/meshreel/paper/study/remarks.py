"""Our choices where the paper leaves them open or contradicts itself."""

LEDGER = "`docs/equations.md`"

CHOICES = (
    "**Eq. 3 or Eq. 4.** The paper presents the two as equivalent, but with L = D - C they differ "
    "by the degree of each vertex. The streams here use Eq. 3, L = I - D^-1 C; `gft` computes its "
    f"frequencies from D - C, which is symmetric ({LEDGER}, Eq. 3).",
    "**The n_b^2 of Eq. 13.** It makes q_d of n_b blocks as large as that of one k x k "
    "dictionary, but storage grows with n_b. q_s contains q_d as printed; the column 'q_d as "
    "stored' uses n_b. Both use the mean bits per entry in the stream for `blocks`, 16 bits "
    f"for all others ({LEDGER}, Eq. 13).",
    "**One coordinate of three.** The paper's q_d = 16 k / n is one k x k dictionary, so it counts "
    "one coordinate matrix, without connectivity. q and q_a are a third of the bits of all "
    "coefficients and anchors in the stream; q_d is the formula of Eq. 13. The column 'bpvf of the "
    "file' counts all bits per vertex and frame: three coordinates, connectivity, order, headers. "
    "Dictionaries are stored with k_l columns of the k that Eq. 13 counts.",
    "**Anchors.** Eq. 12 uses the positions of the anchors in all frames, and Table I counts 16 "
    "bits for each. We code these positions, predicted from the modes, with 4 bits more than the "
    "deltas; the column 'q_a at 16 bits' contains the paper's count. The paper also prints q_a for "
    "v2v, but decoding by a product uses no anchors, so that cell contains '-'. For n = 9971 it "
    "prints 0.1595, which is 99.4 anchors; here their number is rounded up.",
    "**Variant (ii)** is described as the projection of quantized deltas, while Eq. 10 quantizes "
    "projected deltas. `pca-q` follows Eq. 10; `pca-q (quantized deltas)` is the other reading, "
    "which codes its projections with 16 bits.",
    "**NMSVE.** The paper gives no normalization. Positions are divided by the diagonal of the "
    "first frame's bounding box, and a frame's error by 2 n: our values are comparable with each "
    f"other, but not with the axis of the paper's Fig. 4 ({LEDGER}).",
    "**Decoding without anchors.** L of Eq. 11 has no inverse: constants on a component are in "
    "its kernel. `pca` and `pca-q` store one vertex of each component, which only fixes its "
    f"translation ({LEDGER}, Eq. 11).",
    "**Quantizer Q.** Eq. 10 leaves it open. One step is used for all rows, with which the largest "
    "coefficient takes the given bits; the coefficients are entropy-coded, so q is their size in "
    f"the file and not the given bits ({LEDGER}, Eq. 10).",
    "**k_l and bits.** The paper prints neither for its tables. The default is 20 rows, beyond "
    "which its Fig. 3 shows no improvement, and 8 bits, 16 for `pca`; 11 bits for `v2v`, a "
    "compromise between KG and STED, and 4 rows in each block of `blocks`. Values of q are "
    "therefore hardly comparable; the rate-distortion plots show errors at equal rate. Without "
    "entropy coding its Samba rates are nearly 8 rows at 16 and at 4 bits: `--preset printed`.",
    "**Per mesh.** `gft` uses the low graph frequencies of every frame. L is the same for all "
    "frames, so one decomposition suffices; the paper computes one for each.",
)
