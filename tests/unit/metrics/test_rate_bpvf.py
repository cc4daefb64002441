from meshreel.metrics.rate import rate_bpvf


def test_rate_is_bits_per_vertex_and_frame_when_a_file_has_bytes():
    assert rate_bpvf(1000, 20, 50) == 8  # 8000 bits over 20 * 50
