// C# binding of the C library of meshreel; docs/guides/engines.md has examples. Needs Native.cs, Host.cs, and
// libmeshreel.so, libmeshreel.dylib or libmeshreel.dll in the library path of the runtime. C# 7.2 without unsafe code,
// for .NET Framework 4.6, Mono, Unity 2019 and later, and .NET.

using System;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using System.Reflection;
using System.Runtime.InteropServices;
using System.Threading;

namespace Meshreel
{
    public enum ReelCode
    {
        NoMemory = 1, Truncated = 2, Corrupt = 3, Invalid = 4, Unsupported = 5, Method = 6, Unreadable = 7, Range = 8,
        Limit = 9, Segments = 10
    }

    /// <summary>Number type; `Own` is that of the track.</summary>
    public enum ReelType
    {
        Own = 0, Float32 = 4, Float64 = 8, UInt8 = 17, UInt16 = 18, UInt32 = 20, UInt64 = 24, Int8 = 33, Int16 = 34,
        Int32 = 36, Int64 = 40
    }

    public enum ReelAlphaMode { Opaque = 0, Mask = 1, Blend = 2 }
    public enum ReelWrap { Repeat = 0, Mirror = 1, Clamp = 2, Black = 3, Metadata = 4 }

    public enum ReelFilter
    {
        Any = 0, Nearest = 1, Linear = 2, NearestMipmapNearest = 3, LinearMipmapNearest = 4, NearestMipmapLinear = 5,
        LinearMipmapLinear = 6
    }

    /// <summary>The library refused a call. Files and decoders remain usable.</summary>
    public sealed class ReelException : Exception
    {
        public ReelCode Code { get; }
        /// <summary>Byte of the file at which the error was found; null if unknown.</summary>
        public long? Offset { get; }
        /// <summary>Unreadable: size of the range at `Offset`. Limit, NoMemory: bytes that would be allocated.</summary>
        public long Size { get; }

        internal ReelException(ReelCode code, string message, long? offset, long size, Exception cause)
            : base(message, cause)
        {
            Code = code;
            Offset = offset;
            Size = size;
        }
    }

    public sealed class ReelOptions
    {
        private int threads;
        private long memoryLimit;

        /// <summary>Threads that share the work of a call, at least 1; by default one per core.</summary>
        public int Threads
        {
            get { return threads == 0 ? Environment.ProcessorCount : threads; }
            set { threads = value > 0 ? value : throw new ArgumentOutOfRangeException("value", value, "at least 1"); }
        }

        /// <summary>Memory limit of a file and of each decoder, in bytes; 0: 2 GiB.</summary>
        public long MemoryLimit
        {
            get { return memoryLimit; }
            set { memoryLimit = value >= 0 ? value : throw new ArgumentOutOfRangeException("value", value, "at least 0"); }
        }

        internal ReelOptions Copy() => (ReelOptions)MemberwiseClone();
    }

    /// <summary>Metadata of a file, or of a segment opened as one; see `meshreel_info` in meshreel.h.</summary>
    public sealed class ReelInfo
    {
        private Native.info c;
        internal ReelInfo(Native.info c, IntPtr times)
        {
            this.c = c;
            Times = times == IntPtr.Zero ? null : Native.Copied<double>(times, c.n_frames);
            Name = c.name.ToString();
            Damage = c.is_whole == 0 ? Native.Failure(ref this.c.damage, null) : null;
        }

        public string Name { get; }
        /// <summary>Frames per second; 0 if unknown.</summary>
        public double Fps => c.fps;
        /// <summary>Time of each frame in seconds, ascending; null if frames are evenly spaced.</summary>
        public double[] Times { get; }
        public double StartSeconds => c.start_s;
        /// <summary>Error bound of any vertex, in percent of `Diagonal`; 0 if none.</summary>
        public double ErrorBoundPercent => c.error_bound_percent;
        /// <summary>x, y and z of the center of the bounding box of all frames.</summary>
        public double[] Center => new[] { c.center.x, c.center.y, c.center.z };
        public double Diagonal => c.diagonal;
        public long SizeBytes => (long)c.size;
        public int FrameCount => checked((int)c.n_frames);
        public int VertexCount => checked((int)c.n_verts);
        public int TriangleCount => checked((int)c.n_triangles);
        public int FaceCount => checked((int)c.n_faces);
        public int CornerCount => checked((int)c.n_corners);
        /// <summary>Cells of a volume mesh, whose surface the faces are; 0: the mesh has faces only.</summary>
        public int CellCount => checked((int)c.n_cells);
        public int BlockCount => checked((int)c.n_blocks);
        public int LongestBlock => checked((int)c.longest_block);
        /// <summary>Number of tracks including the positions, track 0; 0 for a file with several segments.</summary>
        public int TrackCount => checked((int)c.n_tracks);
        public int SegmentCount => checked((int)c.n_segments);
        /// <summary>Number type of the positions.</summary>
        public ReelType PositionType => (ReelType)c.number_bytes;
        public int Method => (int)c.method;
        /// <summary>Preserved order: 0: of vertices and faces; 1: of vertices; 2: none.</summary>
        public int Order => (int)c.order;
        /// <summary>Why the end of the file is missing; null if the file is complete.</summary>
        public ReelException Damage { get; }
    }

    /// <summary>Frames, mesh size and byte range of a segment.</summary>
    public struct ReelSegment
    {
        public int FirstFrame, FrameCount, VertexCount, TriangleCount;
        public long Offset, SizeBytes;
    }

    /// <summary>Frames of a block, and the byte range of one track in it.</summary>
    public struct ReelBlock
    {
        public int FirstFrame, FrameCount;
        public long Offset, SizeBytes;
    }

    /// <summary>A quantity that changes over time; track 0 is the positions.</summary>
    public sealed class ReelTrack
    {
        private readonly Native.track c;
        internal ReelTrack(Native.track c)
        {
            this.c = c;
            Name = c.name.ToString();
            Unit = c.unit.ToString();
        }

        public string Name { get; }
        public string Unit { get; }
        public ReelTrackKind Kind => (ReelTrackKind)c.kind;
        public ReelDomain Domain => (ReelDomain)c.domain;
        public ReelType Type => (ReelType)c.type;
        /// <summary>Numbers per value.</summary>
        public int ColumnCount => checked((int)c.n_columns);
        /// <summary>Values per frame.</summary>
        public int ItemCount => checked((int)c.n_items);
        public bool IsExact => c.is_exact != 0;
        /// <summary>Error bound of a value, in its unit, for normals in degrees; 0 if none.</summary>
        public double Bound => c.bound;
    }

    /// <summary>Values that do not change over time. Item i of the domain has row `Rows[i]`; row i without
    /// `Rows`. Colors are in sRGB (IEC 61966-2-1), with linear opacity: floats 0..1, integers 0..255.</summary>
    public sealed class ReelAttribute
    {
        public string Name { get; internal set; }
        public ReelAttributeKind Kind { get; internal set; }
        public ReelDomain Domain { get; internal set; }
        /// <summary>Numbers per row.</summary>
        public int Width { get; internal set; }
        /// <summary>Rows of `Width` numbers: float[], double[], byte[] or another array of numbers.</summary>
        public Array Values { get; internal set; }
        public int[] Rows { get; internal set; }
        /// <summary>Items share rows as in an indexed attribute; otherwise rows only save space.</summary>
        public bool IsIndexed { get; internal set; }

        /// <summary>Number `column` of an item, as a double.</summary>
        public double At(int item, int column)
        {
            return Convert.ToDouble(Values.GetValue((long)(Rows == null ? item : Rows[item]) * Width + column));
        }
    }

    /// <summary>Face groups: face i is in group `Labels[OfFaces[i]]`, or in none if that is -1.</summary>
    public sealed class ReelGroups
    {
        public string Name { get; internal set; }
        public string[] Labels { get; internal set; }
        public int[] OfFaces { get; internal set; }
    }

    public sealed class ReelPart
    {
        public string Name { get; internal set; }
        public int VertexCount { get; internal set; }
        public int FaceCount { get; internal set; }
    }

    public sealed class ReelTexture
    {
        public int Image { get; internal set; }
        /// <summary>Bits 0 to 3: red, green, blue, alpha.</summary>
        public int Channels { get; internal set; }
        public ReelWrap WrapU { get; internal set; }
        public ReelWrap WrapV { get; internal set; }
        public ReelFilter Magnified { get; internal set; }
        public ReelFilter Shrunk { get; internal set; }
        /// <summary>Name of the UV attribute.</summary>
        public string Uv { get; internal set; }
        public double[] Offset { get; internal set; }
        public double Rotation { get; internal set; }
        public double[] Scale { get; internal set; }
    }

    /// <summary>A material with the parameters of glTF; its colors are linear. Missing textures are null.</summary>
    public sealed class ReelMaterial
    {
        public string Name { get; internal set; }
        public ReelAlphaMode AlphaMode { get; internal set; }
        public bool IsDoubleSided { get; internal set; }
        public bool IsUnlit { get; internal set; }
        public double[] BaseColor { get; internal set; }
        public double Metallic { get; internal set; }
        public double Roughness { get; internal set; }
        public double[] Emissive { get; internal set; }
        public double NormalScale { get; internal set; }
        public double OcclusionStrength { get; internal set; }
        public double AlphaCutoff { get; internal set; }
        public ReelTexture BaseColorTexture { get; internal set; }
        public ReelTexture MetallicTexture { get; internal set; }
        public ReelTexture RoughnessTexture { get; internal set; }
        public ReelTexture NormalTexture { get; internal set; }
        public ReelTexture OcclusionTexture { get; internal set; }
        public ReelTexture EmissiveTexture { get; internal set; }
    }

    /// <summary>An image file: a byte range of the .reel file, for `ReelFile.Read`.</summary>
    public sealed class ReelImage
    {
        public string Name { get; internal set; }
        public string MediaType { get; internal set; }
        public long Offset { get; internal set; }
        public long SizeBytes { get; internal set; }
    }

    /// <summary>Cells of a volume mesh, such as hexahedra.</summary>
    public sealed class ReelCells
    {
        /// <summary>Types of VTK.</summary>
        public byte[] Types { get; internal set; }
        /// <summary>Vertices of all cells, concatenated, in the order of VTK.</summary>
        public int[] Nodes { get; internal set; }
        /// <summary>Cell of each face.</summary>
        public int[] OfFaces { get; internal set; }
    }

    /// <summary>The surface: everything about the mesh but positions and triangles.</summary>
    public sealed class ReelSurface
    {
        /// <summary>Corners of each face, or null: all are triangles. A face of n corners is the next n - 2
        /// triangles.</summary>
        public int[] FaceSizes { get; internal set; }
        /// <summary>Face corner, numbered face by face, at each corner of the triangles, or null: the same.</summary>
        public int[] TriangleCorners { get; internal set; }
        public ReelAttribute[] Attributes { get; internal set; }
        public ReelGroups[] Groups { get; internal set; }
        public ReelPart[] Parts { get; internal set; }
        public ReelMaterial[] Materials { get; internal set; }
        public ReelImage[] Images { get; internal set; }
        /// <summary>Edges, two vertices each, across which faces do not share normals.</summary>
        public int[] HardEdges { get; internal set; }
        /// <summary>Cells whose surface the faces are; null if the mesh has faces only.</summary>
        public ReelCells Cells { get; internal set; }

        internal ReelSurface(Native.surface c, IntPtr cells, ReelInfo info)
        {
            int faceCount = info.FaceCount;
            if (cells != IntPtr.Zero)
            {
                Native.cells of = Native.At<Native.cells>(cells);
                Cells = new ReelCells
                {
                    Types = Native.Copied<byte>(of.types, of.n_cells), Nodes = Native.Copied<int>(of.nodes, of.n_nodes),
                    OfFaces = Native.Copied<int>(of.face_cells, faceCount),
                };
            }
            FaceSizes = Native.Copied<int>(c.face_sizes, faceCount);
            TriangleCorners = Native.Copied<int>(c.triangle_corners, 3L * info.TriangleCount);
            HardEdges = Native.Copied<int>(c.hard_edges, 2L * c.n_hard_edges);
            Attributes = Native.Each<Native.attribute, ReelAttribute>(c.attributes, c.n_attributes, a => new ReelAttribute
            {
                Name = a.name.ToString(), Kind = (ReelAttributeKind)a.kind, Domain = (ReelDomain)a.domain,
                Width = (int)a.width, Values = Native.Copied(a.values, (ReelType)a.type, (long)a.n_rows * a.width),
                Rows = a.rows == IntPtr.Zero ? null : Native.Copied<int>(a.rows, a.n_items),
                IsIndexed = a.is_indexed != 0,
            });
            Groups = Native.Each<Native.groups, ReelGroups>(c.groups, c.n_groups, g => new ReelGroups
            {
                Name = g.name.ToString(),
                Labels = Native.Each<Native.text, string>(g.labels, g.n_labels, label => label.ToString()),
                OfFaces = Native.Copied<int>(g.of_faces, faceCount),
            });
            Parts = Native.Each<Native.part, ReelPart>(c.parts, c.n_parts, p => new ReelPart
            {
                Name = p.name.ToString(), VertexCount = (int)p.n_verts, FaceCount = (int)p.n_faces,
            });
            Materials = Native.Each<Native.material, ReelMaterial>(c.materials, c.n_materials, m => new ReelMaterial
            {
                Name = m.name.ToString(), AlphaMode = (ReelAlphaMode)m.alpha_mode,
                IsDoubleSided = m.is_double_sided != 0, IsUnlit = m.is_unlit != 0,
                BaseColor = new[] { m.base_color.x, m.base_color.y, m.base_color.z, m.base_color.w },
                Metallic = m.metallic, Roughness = m.roughness,
                Emissive = new[] { m.emissive.x, m.emissive.y, m.emissive.z },
                NormalScale = m.normal_scale, OcclusionStrength = m.occlusion_strength, AlphaCutoff = m.alpha_cutoff,
                BaseColorTexture = Texture(m.textures.base_color), MetallicTexture = Texture(m.textures.metallic),
                RoughnessTexture = Texture(m.textures.roughness), NormalTexture = Texture(m.textures.normal),
                OcclusionTexture = Texture(m.textures.occlusion), EmissiveTexture = Texture(m.textures.emissive),
            });
            Images = Native.Each<Native.image, ReelImage>(c.images, c.n_images, i => new ReelImage
            {
                Name = i.name.ToString(), MediaType = i.media_type.ToString(), Offset = (long)i.offset,
                SizeBytes = (long)i.size,
            });
        }

        private static ReelTexture Texture(Native.texture t)
        {
            return t.image == Native.None ? null : new ReelTexture
            {
                Image = (int)t.image, Channels = (int)t.channels, WrapU = (ReelWrap)t.wrap_u, WrapV = (ReelWrap)t.wrap_v,
                Magnified = (ReelFilter)t.magnified, Shrunk = (ReelFilter)t.shrunk, Uv = t.uv.ToString(),
                Offset = new[] { t.offset.x, t.offset.y }, Rotation = t.rotation, Scale = new[] { t.scale.x, t.scale.y },
            };
        }
    }

    /// <summary>A track in a block as a sum of modes, for evaluation on the GPU; see `meshreel_modes` in
    /// meshreel.h.</summary>
    public sealed class ReelModes
    {
        public int FrameCount { get; internal set; }
        /// <summary>0: the track has no modes in this block.</summary>
        public int ModeCount { get; internal set; }
        public int ColumnCount { get; internal set; }
        public int ItemCount { get; internal set; }
        public bool HasMissing { get; internal set; }
        public double Step { get; internal set; }
        public double Scale { get; internal set; }
        public double[] Origin { get; internal set; }
        /// <summary>`ItemCount` rows of `ModeCount` numbers; item i has row `Rows[i]`.</summary>
        public double[] Values { get; internal set; }
        public int[] Rows { get; internal set; }
        /// <summary>For each column, `FrameCount` rows of `ModeCount` numbers.</summary>
        public double[] Basis { get; internal set; }
        /// <summary>Item whose modes each item of the track shares; null: its own.</summary>
        public int[] Shared { get; internal set; }
        /// <summary>Corrections of frame t: `CorrectionStarts[t]` to `CorrectionStarts[t + 1] - 1`; null if none.</summary>
        public long[] CorrectionStarts { get; internal set; }
        public int[] Corrected { get; internal set; }
        public double[] Corrections { get; internal set; }

        internal ReelModes(Native.modes c, int itemCount)
        {
            FrameCount = checked((int)c.n_frames);
            ModeCount = checked((int)c.n_modes);
            ColumnCount = checked((int)c.n_columns);
            ItemCount = checked((int)c.n_items);
            HasMissing = c.has_missing != 0;
            Step = c.step;
            Scale = c.scale;
            if (ModeCount == 0)
            {
                return;
            }
            Origin = Native.Copied<double>(c.origin, ColumnCount);
            Values = Native.Copied<double>(c.values, (long)ItemCount * ModeCount);
            Rows = Native.Copied<int>(c.rows, ItemCount);
            Basis = Native.Copied<double>(c.basis, (long)ColumnCount * FrameCount * ModeCount);
            Shared = Native.Copied<int>(c.shared, itemCount);
            CorrectionStarts = Native.Copied<long>(c.correction_starts, FrameCount + 1L);
            if (CorrectionStarts != null)
            {
                long count = CorrectionStarts[FrameCount];
                Corrected = Native.Copied<int>(c.corrected, count);
                Corrections = Native.Copied<double>(c.corrections, count * ColumnCount);
            }
        }
    }

    /// <summary>An open .reel file, or one of its segments. All members are thread-safe. It is
    /// closed once it and its decoders are disposed.</summary>
    public sealed class ReelFile : IDisposable
    {
        private readonly ReaderWriterLockSlim use = new ReaderWriterLockSlim(); // the mesh and the surface are written once
        private volatile bool hasMesh;
        private volatile int[] triangles;
        private volatile ReelSurface surface;
        private readonly ReelTrack[] tracks;
        internal FileHandle Handle { get; }

        public ReelInfo Info { get; }
        /// <summary>Tracks, with the positions first; empty for a file with several segments.</summary>
        public IReadOnlyList<ReelTrack> Tracks => tracks;

        private ReelFile(Host host, ReelFile whole, uint segment)
        {
            Handle = new FileHandle(host);
            try
            {
                uint abi = Native.meshreel_abi();
                if (abi != Native.Abi)
                {
                    throw new NotSupportedException("the library has interface " + abi + "; these bindings need "
                        + Native.Abi + ": update the older one");
                }
                if (whole == null)
                {
                    Handle.Open();
                }
                else
                {
                    Handle.OpenSegment(whole.Handle, segment);
                }
                Info = new ReelInfo(Native.At<Native.info>(Native.meshreel_info_of(Handle)),
                    Native.meshreel_times_of(Handle));
                tracks = new ReelTrack[Info.TrackCount];
                for (int i = 0; i < tracks.Length; i++)
                {
                    Native.track found;
                    Existing(Native.meshreel_track_of(Handle, (uint)i, out found), "track", i);
                    tracks[i] = new ReelTrack(found);
                }
            }
            catch
            {
                Handle.Dispose();
                throw;
            }
        }

        /// <summary>Open a file in memory. The bytes are not copied; they must not change until it is closed.</summary>
        public static ReelFile Open(byte[] bytes, ReelOptions options = null)
        {
            if (bytes == null)
            {
                throw new ArgumentNullException("bytes");
            }
            return new ReelFile(new Host(bytes, null, false, options), null, 0);
        }

        /// <summary>Open a file on disk; ranges are read on demand.</summary>
        public static ReelFile Open(string path, ReelOptions options = null)
        {
            return Open(File.OpenRead(path), false, options);
        }

        /// <summary>Open a file in a seekable stream, such as an asset in an archive. Reads are serialized.
        /// The stream is disposed with the file, unless `leaveOpen`.</summary>
        public static ReelFile Open(Stream stream, bool leaveOpen = false, ReelOptions options = null)
        {
            if (stream == null || !stream.CanSeek || !stream.CanRead)
            {
                throw new ArgumentException("the stream must be readable and able to seek", "stream");
            }
            return new ReelFile(new Host(null, stream, leaveOpen, options), null, 0);
        }

        public void Dispose() => Handle.Dispose();

        /// <summary>Describe segment `number`, counted from 0.</summary>
        public ReelSegment Segment(int number)
        {
            Native.segment c;
            Existing(Native.meshreel_segment_of(Handle, (uint)number, out c), "segment", number);
            return new ReelSegment
            {
                FirstFrame = checked((int)c.first_frame), FrameCount = checked((int)c.n_frames),
                VertexCount = checked((int)c.n_verts), TriangleCount = checked((int)c.n_triangles),
                Offset = (long)c.offset, SizeBytes = (long)c.size,
            };
        }

        public int SegmentOfFrame(int frame)
        {
            CheckFrame(frame);
            return checked((int)Native.meshreel_segment_of_frame(Handle, (uint)frame));
        }

        /// <summary>The frame that is shown at a time in seconds: the last one that is due, else frame 0.</summary>
        public int FrameAt(double seconds)
        {
            return checked((int)Native.meshreel_frame_at(Handle, seconds));
        }

        /// <summary>Open a segment as a separate file, whose frames are counted from 0.</summary>
        public ReelFile OpenSegment(int number)
        {
            Segment(number); // throws if the segment does not exist
            return new ReelFile(Handle.Host, this, (uint)number);
        }

        /// <summary>Describe block `number`, with the byte range of a track.</summary>
        public ReelBlock Block(int number, int track = 0)
        {
            Native.block c;
            Existing(Native.meshreel_block_of(Handle, (uint)number, (uint)track, out c), "block", number);
            return new ReelBlock
            {
                FirstFrame = checked((int)c.first_frame), FrameCount = checked((int)c.n_frames), Offset = (long)c.offset,
                SizeBytes = (long)c.size,
            };
        }

        public int BlockOfFrame(int frame)
        {
            CheckFrame(frame);
            return checked((int)Native.meshreel_block_of_frame(Handle, (uint)frame));
        }

        /// <summary>Number of modes of a track in a block; 0 if its values are exact.</summary>
        public int ModeCount(int block, int track = 0)
        {
            Native.group c;
            Native.error error;
            Native.Check(Native.meshreel_group_of(Handle, (uint)block, (uint)track, 0, out c, out error), ref error);
            return checked((int)c.n_modes);
        }

        /// <summary>Three vertices per triangle, counterclockwise from the front if encoded so. A shared array:
        /// do not change it. The first call decodes the mesh.</summary>
        public int[] Triangles
        {
            get
            {
                ReadMesh();
                return triangles;
            }
        }

        /// <summary>The surface. The first call decodes it.</summary>
        public ReelSurface Surface
        {
            get
            {
                if (surface == null)
                {
                    Write(() =>
                    {
                        Native.error error;
                        Native.Check(Native.meshreel_read_surface(Handle, out error), ref error);
                        surface = surface ?? new ReelSurface(
                            Native.At<Native.surface>(Native.meshreel_surface_of(Handle)),
                            Native.meshreel_cells_of(Handle), Info);
                    });
                }
                return surface;
            }
        }

        /// <summary>Copy bytes of the file, such as those of an image.</summary>
        public byte[] Read(long offset, long size)
        {
            if (offset < 0 || size < 0 || size > Info.SizeBytes - offset)
            {
                throw new ArgumentOutOfRangeException("offset", offset, "the file has " + Info.SizeBytes + " bytes");
            }
            var read = new byte[size];
            long done = 0;
            Handle.Host.Read(offset, size, (piece, count) =>
            {
                Array.Copy(piece, 0, read, done, count);
                done += count;
            });
            return read;
        }

        internal void ReadMesh()
        {
            if (!hasMesh)
            {
                Write(() =>
                {
                    Native.error error;
                    Native.Check(Native.meshreel_read_mesh(Handle, out error), ref error);
                    triangles = Native.Copied<int>(Native.meshreel_triangles(Handle), 3L * Info.TriangleCount);
                    hasMesh = true;
                });
            }
        }

        /// <summary>Keep other threads from decoding the mesh or the surface; `EndUse` allows it again.</summary>
        internal void BeginUse() => use.EnterReadLock();
        internal void EndUse() => use.ExitReadLock();

        private void Write(Action read)
        {
            use.EnterWriteLock();
            try
            {
                read();
            }
            finally
            {
                use.ExitWriteLock();
            }
        }

        private void CheckFrame(int frame)
        {
            if (frame < 0 || frame >= Info.FrameCount)
            {
                throw new ArgumentOutOfRangeException("frame", frame, "the file has " + Info.FrameCount + " frames");
            }
        }

        private static void Existing(int code, string what, int number)
        {
            if (code != 0)
            {
                throw new ArgumentOutOfRangeException(what, number, "the file has no such " + what);
            }
        }
    }

    /// <summary>Layout of decoded values: value i of frame t begins at byte `Offset + t FrameStride + i ValueStride`. A
    /// stride of 0 means packed.</summary>
    public struct ReelLayout
    {
        /// <summary>`Own`, or `Float32` for a track of doubles.</summary>
        public ReelType Type;
        public long Offset, ValueStride, FrameStride;
    }

    /// <summary>Decodes frames. Caches two decoded blocks of each track. Calls from several threads are serialized;
    /// separate decoders work in parallel.</summary>
    public sealed class ReelDecoder : IDisposable
    {
        private readonly ReelFile file;
        private readonly DecoderHandle handle;
        private readonly object turn = new object();

        public ReelDecoder(ReelFile file)
        {
            if (file == null)
            {
                throw new ArgumentNullException("file");
            }
            this.file = file;
            file.ReadMesh();
            handle = new DecoderHandle(file.Handle);
            try
            {
                using (Use())
                {
                    handle.Begin();
                }
            }
            catch
            {
                handle.Dispose();
                throw;
            }
        }

        public void Dispose() => handle.Dispose();

        /// <summary>Load a track of a block in advance, which is the slow part of decoding. With `modes` above 0 it is a
        /// preview with only that many animated modes.</summary>
        public void Load(int track, int block, int modes = 0)
        {
            using (Use())
            {
                Native.error error;
                int code = Native.meshreel_load(handle, (uint)track, (uint)block, (uint)modes, out error);
                Native.Check(code, ref error);
            }
        }

        /// <summary>Decode `count` frames to an array of numbers or of blittable structures. A float[] receives converted
        /// doubles too; other arrays of numbers must have the type of the track.</summary>
        /// <exception cref="ReelException">The file is damaged, or a frame is out of range.</exception>
        /// <exception cref="ArgumentException">The array is too short, or of another type.</exception>
        public void Decode<T>(
            int track, int first, int count, T[] values, ReelLayout layout = default(ReelLayout), int modes = 0)
            where T : struct
        {
            if (values == null)
            {
                throw new ArgumentNullException("values");
            }
            if (!Element<T>.IsBlittable)
            {
                throw new ArgumentException(typeof(T) + " is not laid out in memory as in C", "values");
            }
            ReelType own = Track(track).Type;
            bool narrows = own == ReelType.Float64 && Element<T>.Type == ReelType.Float32;
            ReelType type = layout.Type != ReelType.Own ? layout.Type : narrows ? ReelType.Float32 : own;
            if (Element<T>.Type != ReelType.Own && Element<T>.Type != type)
            {
                throw new ArgumentException(
                    "the numbers are of type " + type + ", the array of type " + Element<T>.Type, "values");
            }
            layout.Type = type;
            GCHandle pinned = GCHandle.Alloc(values, GCHandleType.Pinned);
            try
            {
                long size = values.LongLength * Element<T>.Size;
                Decode(track, first, count, pinned.AddrOfPinnedObject(), size, layout, modes);
            }
            finally
            {
                pinned.Free();
            }
        }

        /// <summary>Decode `count` frames to `size` bytes of memory, such as that of a NativeArray.</summary>
        public void Decode(
            int track, int first, int count, IntPtr values, long size, ReelLayout layout = default(ReelLayout), int modes = 0)
        {
            ReelTrack what = Track(track);
            ReelType type = layout.Type == ReelType.Own ? what.Type : layout.Type;
            int number = (int)type & 15;
            long width = (long)number * what.ColumnCount;
            if (layout.Offset < 0 || layout.ValueStride < 0 || layout.FrameStride < 0 || count < 0)
            {
                throw new ArgumentOutOfRangeException("layout", "offset, strides and count must not be negative");
            }
            if (number == 0 || (values.ToInt64() + layout.Offset) % number != 0)
            {
                throw new ArgumentException("values must be aligned to their type, " + type, "layout");
            }
            long stride = layout.ValueStride > 0 ? layout.ValueStride : width;
            long frame = layout.FrameStride > 0 ? layout.FrameStride : checked(stride * what.ItemCount);
            long end = count == 0 || what.ItemCount == 0 ? 0
                : checked(layout.Offset + (count - 1) * frame + (what.ItemCount - 1) * stride + width);
            if (end > size)
            {
                throw new ArgumentException(count + " frames need " + end + " bytes; there are " + size, "values");
            }
            var c = new Native.layout
            {
                type = (uint)type, value_stride = new UIntPtr((ulong)layout.ValueStride),
                frame_stride = new UIntPtr((ulong)layout.FrameStride),
            };
            using (Use())
            {
                Native.error error;
                var to = new IntPtr(values.ToInt64() + layout.Offset);
                int code = Native.meshreel_decode(
                    handle, (uint)track, (uint)first, (uint)count, (uint)modes, ref c, to, out error);
                Native.Check(code, ref error);
            }
        }

        /// <summary>Decode `count` frames to a new array of packed numbers.</summary>
        public T[] Frames<T>(int track, int first, int count, int modes = 0) where T : struct
        {
            ReelTrack what = Track(track);
            var values = new T[checked((long)Math.Max(count, 0) * what.ItemCount * what.ColumnCount)];
            Decode(track, first, count, values, default(ReelLayout), modes);
            return values;
        }

        /// <summary>Decode `count` frames to a new array of the number type of the track.</summary>
        public Array Frames(int track, int first, int count, int modes = 0)
        {
            ReelTrack what = Track(track);
            long length = checked((long)Math.Max(count, 0) * what.ItemCount * what.ColumnCount);
            Array values = Array.CreateInstance(Native.NumberTypes[what.Type], length);
            GCHandle pinned = GCHandle.Alloc(values, GCHandleType.Pinned);
            try
            {
                long size = length * ((int)what.Type & 15);
                Decode(track, first, count, pinned.AddrOfPinnedObject(), size, default(ReelLayout), modes);
            }
            finally
            {
                pinned.Free();
            }
            return values;
        }

        /// <summary>The modes of a track in a block, copied; loads the block.</summary>
        public ReelModes Modes(int track, int block)
        {
            using (Use())
            {
                Native.modes c;
                Native.error error;
                int code = Native.meshreel_modes_of(handle, (uint)track, (uint)block, out c, out error);
                Native.Check(code, ref error);
                return new ReelModes(c, Track(track).ItemCount);
            }
        }

        /// <summary>Compute vertex normals from the positions of a frame: float[], double[], or structures of three of
        /// them such as Vector3. Normals have length 1, or 0 if undefined.</summary>
        public void Normals<T>(T[] positions, T[] normals) where T : struct
        {
            if (positions == null || normals == null)
            {
                throw new ArgumentNullException(positions == null ? "positions" : "normals");
            }
            long size = Element<T>.Size * positions.LongLength, count = 3L * file.Info.VertexCount;
            ReelType type = size == 4 * count ? ReelType.Float32 : ReelType.Float64;
            bool isOther = Element<T>.Type != ReelType.Own && Element<T>.Type != type;
            if (!Element<T>.IsBlittable || isOther || size != (long)type * count || normals.Length != positions.Length)
            {
                throw new ArgumentException("positions and normals must be " + count + " floats or doubles each");
            }
            GCHandle from = GCHandle.Alloc(positions, GCHandleType.Pinned);
            GCHandle to = GCHandle.Alloc(normals, GCHandleType.Pinned);
            try
            {
                using (Use())
                {
                    Native.error error;
                    int code = Native.meshreel_normals(
                        handle, (uint)type, from.AddrOfPinnedObject(), to.AddrOfPinnedObject(), out error);
                    Native.Check(code, ref error);
                }
            }
            finally
            {
                from.Free();
                to.Free();
            }
        }

        private ReelTrack Track(int number)
        {
            if (number < 0 || number >= file.Tracks.Count)
            {
                throw new ArgumentOutOfRangeException("track", number, "the file has " + file.Tracks.Count + " tracks");
            }
            return file.Tracks[number];
        }

        private Turn Use() => new Turn(this);

        /// <summary>Lock the decoder, and keep other threads from modifying the file.</summary>
        private struct Turn : IDisposable
        {
            private readonly ReelDecoder decoder;

            internal Turn(ReelDecoder decoder)
            {
                this.decoder = decoder;
                Monitor.Enter(decoder.turn);
                decoder.file.BeginUse();
            }

            public void Dispose()
            {
                decoder.file.EndUse();
                Monitor.Exit(decoder.turn);
            }
        }

        /// <summary>The memory layout of array elements.</summary>
        private static class Element<T>
        {
            internal static readonly bool IsBlittable = HasNumbersOnly(typeof(T));
            internal static readonly long Size = IsBlittable ? Marshal.SizeOf(typeof(T)) : 0;
            internal static readonly ReelType Type =
                Native.NumberTypes.FirstOrDefault(number => number.Value == typeof(T)).Key;

            private static bool HasNumbersOnly(Type type)
            {
                if (type.IsPrimitive || type.IsEnum)
                {
                    return type != typeof(bool) && type != typeof(char);
                }
                const BindingFlags All = BindingFlags.Instance | BindingFlags.Public | BindingFlags.NonPublic;
                return type.IsValueType && !type.IsAutoLayout
                    && Array.TrueForAll(type.GetFields(All), field => HasNumbersOnly(field.FieldType));
            }
        }
    }
}
