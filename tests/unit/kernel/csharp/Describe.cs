// Prints what files hold, for test_csharp.py to compare: `Describe layouts`, or `Describe [bytes|path|threads] FILE...`.

using System;
using System.Globalization;
using System.IO;
using System.Linq;
using System.Runtime.InteropServices;
using System.Security.Cryptography;
using Meshreel;

internal static class Describe
{
    private struct Vertex
    {
        public float Before, X, Y, Z, After;
    }

    private static int Main(string[] words)
    {
        CultureInfo.CurrentCulture = CultureInfo.InvariantCulture;
        if (words[0] == "layouts")
        {
            Layouts();
            return 0;
        }
        foreach (string path in words.Skip(1))
        {
            try
            {
                Whole(path, words[0]);
            }
            catch (ReelException failure)
            {
                Console.WriteLine("failed {0} {1} {2}", (int)failure.Code, failure.Offset, failure.Message);
            }
        }
        return 0;
    }

    private static ReelFile Opened(string path, string way)
    {
        switch (way)
        {
            case "bytes": return ReelFile.Open(File.ReadAllBytes(path), new ReelOptions { Threads = 1 });
            case "path": return ReelFile.Open(path, new ReelOptions { Threads = 1 });
            case "threads": return ReelFile.Open(path, new ReelOptions { Threads = 3 });
            default: throw new ArgumentException(way);
        }
    }

    private static void Whole(string path, string way)
    {
        using (ReelFile file = Opened(path, way))
        {
            ReelInfo info = file.Info;
            Console.WriteLine("file {0} frames, {1} segments, {2} fps, start {3}, whole {4}", info.FrameCount,
                info.SegmentCount, info.Fps, info.StartSeconds, info.Damage == null);
            Console.WriteLine("times {0}", Hash(info.Times));
            Console.WriteLine("shown {0} {1} {2}", file.FrameAt(-1), file.FrameAt(1.99), file.FrameAt(1e9));
            for (int i = 0; i < info.SegmentCount; i++)
            {
                ReelSegment segment = file.Segment(i);
                Console.WriteLine("segment {0} {1} {2} {3} {4}", i, segment.FirstFrame, segment.FrameCount,
                    segment.Offset, file.SegmentOfFrame(segment.FirstFrame + segment.FrameCount - 1));
                using (ReelFile opened = file.OpenSegment(i))
                {
                    Segment(opened);
                }
            }
        }
    }

    private static void Segment(ReelFile file)
    {
        ReelInfo info = file.Info;
        Console.WriteLine("mesh '{0}' {1} {2} {3} {4}", info.Name, info.VertexCount, info.TriangleCount, info.FaceCount,
            info.CornerCount);
        Console.WriteLine("box {0}", Hash(info.Center.Concat(new[] { info.Diagonal, info.ErrorBoundPercent }).ToArray()));
        Console.WriteLine("triangles {0}", Hash(file.Triangles));
        using (var decoder = new ReelDecoder(file))
        {
            for (int i = 0; i < file.Tracks.Count; i++)
            {
                ReelTrack track = file.Tracks[i];
                ReelBlock last = file.Block(info.BlockCount - 1, i);
                Console.WriteLine("track '{0}' '{1}' {2} {3} {4} {5} {6}", track.Name, track.Unit, (int)track.Kind,
                    (int)track.Domain, (int)track.Type, Hash(new[] { track.Bound }), track.IsExact);
                Console.WriteLine("block {0} {1} {2} {3} modes {4}", last.FirstFrame, last.FrameCount, last.Offset,
                    last.SizeBytes, file.ModeCount(info.BlockCount - 1, i));
                Console.WriteLine("values {0}", Hash(decoder.Frames(i, 0, info.FrameCount)));
                int middle = info.FrameCount / 2;
                Console.WriteLine("later {0}", Hash(decoder.Frames(i, middle, info.FrameCount - middle)));
            }
            Console.WriteLine("modes {0}", Hash(Summed(decoder, decoder.Modes(0, 0), info.VertexCount)));
            Console.WriteLine("preview {0}", Hash(decoder.Frames<float>(0, 0, info.FrameCount, modes: 2)));
            float[] floats = decoder.Frames<float>(0, info.FrameCount - 1, 1), normals = new float[floats.Length];
            decoder.Normals(floats, normals);
            Console.WriteLine("floats {0}", Hash(floats));
            Console.WriteLine("normals {0}", Hash(normals));
            var vertices = new Vertex[2 * info.VertexCount];
            var layout = new ReelLayout { Type = ReelType.Float32, Offset = 4, ValueStride = 20 };
            decoder.Decode(0, 0, Math.Min(2, info.FrameCount), vertices, layout);
            Console.WriteLine("strided {0}", Hash(vertices.SelectMany(v => new[] { v.Before, v.X, v.Y, v.Z, v.After }).ToArray()));
            if (info.PositionType == ReelType.Float64)
            {
                double[] doubles = decoder.Frames<double>(0, 0, 1), exact = new double[doubles.Length];
                decoder.Normals(doubles, exact);
                Console.WriteLine("doubles {0}", Hash(exact));
            }
        }
        Surface(file);
    }

    /// <summary>Arrays and numbers of the modes, in the order of the header.</summary>
    private static double[] Summed(ReelDecoder decoder, ReelModes modes, int count)
    {
        var numbers = new double[] { modes.FrameCount, modes.ModeCount, modes.ColumnCount, modes.ItemCount };
        return modes.ModeCount == 0 ? numbers : numbers.Concat(new[] { modes.Step, modes.Scale }).Concat(modes.Origin)
            .Concat(modes.Values).Concat(modes.Rows.Select(row => (double)row)).Concat(modes.Basis)
            .Concat((modes.CorrectionStarts ?? new long[0]).Select(start => (double)start))
            .Concat((modes.Corrected ?? new int[0]).Select(item => (double)item))
            .Concat(modes.Corrections ?? new double[0]).ToArray();
    }

    private static void Surface(ReelFile file)
    {
        ReelSurface surface = file.Surface;
        Console.WriteLine("faces {0} hard {1}", Hash(surface.FaceSizes), Hash(surface.HardEdges));
        ReelCells cells = surface.Cells;
        Console.WriteLine("cells {0} {1} {2} {3}", file.Info.CellCount, Hash(cells?.Types), Hash(cells?.Nodes),
            Hash(cells?.OfFaces));
        foreach (ReelAttribute a in surface.Attributes)
        {
            int count = a.Rows == null ? a.Values.Length / a.Width : a.Rows.Length;
            var each = new double[count * a.Width];
            for (int i = 0; i < each.Length; i++)
            {
                each[i] = a.At(i / a.Width, i % a.Width);
            }
            Console.WriteLine("attribute '{0}' {1} {2} {3} {4} {5} {6} {7}", a.Name, (int)a.Kind, (int)a.Domain, a.Width,
                a.Values.GetType().GetElementType().Name, Hash(a.IsIndexed ? a.Values : null),
                Hash(a.IsIndexed ? a.Rows : null), Hash(each));
        }
        foreach (ReelGroups groups in surface.Groups)
        {
            Console.WriteLine("groups '{0}' {1} {2}", groups.Name, string.Join("|", groups.Labels), Hash(groups.OfFaces));
        }
        foreach (ReelPart part in surface.Parts)
        {
            Console.WriteLine("part '{0}' {1} {2}", part.Name, part.VertexCount, part.FaceCount);
        }
        foreach (ReelMaterial m in surface.Materials)
        {
            var numbers = m.BaseColor.Concat(new[] { m.Metallic, m.Roughness }).Concat(m.Emissive)
                .Concat(new[] { m.NormalScale, m.OcclusionStrength, m.AlphaCutoff }).ToArray();
            Console.WriteLine("material '{0}' {1} {2} {3} {4}", m.Name, (int)m.AlphaMode, m.IsDoubleSided, m.IsUnlit,
                Hash(numbers));
            foreach (ReelTexture t in new[] { m.BaseColorTexture, m.MetallicTexture, m.RoughnessTexture, m.NormalTexture,
                                              m.OcclusionTexture, m.EmissiveTexture })
            {
                Console.WriteLine(t == null ? "no texture" : string.Format("texture {0} {1} {2} {3} {4} {5} '{6}' {7}",
                    t.Image, t.Channels, (int)t.WrapU, (int)t.WrapV, (int)t.Magnified, (int)t.Shrunk, t.Uv,
                    Hash(t.Offset.Concat(new[] { t.Rotation }).Concat(t.Scale).ToArray())));
            }
        }
        foreach (ReelImage image in surface.Images)
        {
            Console.WriteLine("image '{0}' {1} {2}", image.Name, image.MediaType,
                Hash(file.Read(image.Offset, image.SizeBytes)));
        }
    }

    /// <summary>Hash of the bytes of numbers; "-" of null.</summary>
    private static string Hash(Array numbers)
    {
        if (numbers == null)
        {
            return "-";
        }
        var bytes = new byte[Buffer.ByteLength(numbers)];
        Buffer.BlockCopy(numbers, 0, bytes, 0, bytes.Length);
        using (SHA256 sha = SHA256.Create())
        {
            return BitConverter.ToString(sha.ComputeHash(bytes)).Replace("-", "").ToLowerInvariant();
        }
    }

    /// <summary>Structures as samples/c_interface.py lists them.</summary>
    private static void Layouts()
    {
        foreach (Type type in typeof(Native).GetNestedTypes(System.Reflection.BindingFlags.NonPublic))
        {
            if (!type.IsValueType || new[] { "pair", "triple", "quadruple", "slots" }.Contains(type.Name))
            {
                continue;
            }
            Console.WriteLine("size meshreel_{0} {1}", type.Name, Marshal.SizeOf(type));
            foreach (var field in type.GetFields(System.Reflection.BindingFlags.Instance
                                                 | System.Reflection.BindingFlags.Public))
            {
                Console.WriteLine("offset meshreel_{0}.{1} {2}", type.Name, field.Name,
                    Marshal.OffsetOf(type, field.Name));
            }
        }
    }
}
